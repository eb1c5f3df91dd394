//! Parses conditions: comparisons joined by `&&`, `||`, `!` and parentheses, and PDAL's ranges and lists of them.

use super::condition::{Condition, Operand, RELATIONS, Relation};
use crate::error::{Error, Result};
use crate::image::class_named;
use crate::points::{KnownColumn, plain_name};

/// Maximum depth of parentheses and negations, far below what the stack takes.
const MAX_DEPTH: usize = 100;

/// Parses a condition.
pub(super) fn parse(text: &str) -> Result<Condition> {
    let mut parser = Parser { text, at: 0, depth: 0 };
    let mut condition = parser.any()?;
    if parser.peek(",") {
        parser.at = 0;
        condition = parser.ranges()?;
    }
    parser.skip_spaces();
    if parser.at < text.len() {
        return Err(parser.fail("&&, || or the end"));
    }
    Ok(condition)
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
}

impl<'a> Parser<'a> {
    /// Parses ranges joined by commas, as the filter `filters.range` of PDAL: a point is within one range of each column.
    fn ranges(&mut self) -> Result<Condition> {
        let mut by_column: Vec<(String, Vec<Condition>)> = Vec::new();
        loop {
            let column = match self.operand()? {
                Operand::Column(name) if self.begins_range() => name,
                _ => return Err(self.fail("a range as in Z[0:10], as commas join nothing else")),
            };
            let known = KnownColumn::from_name(&column);
            let key = known.map_or_else(|| plain_name(&column), |known| known.name().to_owned());
            let range = self.range(&Operand::Column(column))?;
            match by_column.iter_mut().find(|(other, _)| *other == key) {
                Some((_, ranges)) => ranges.push(range),
                None => by_column.push((key, vec![range])),
            }
            if !self.take(",") {
                break;
            }
        }
        let parts = by_column.into_iter().map(|(_, ranges)| Condition::Any(ranges));
        Ok(Condition::All(parts.collect()))
    }

    fn any(&mut self) -> Result<Condition> {
        let mut parts = vec![self.all()?];
        while self.take("||") || self.take_word("or") {
            parts.push(self.all()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Condition::Any(parts) })
    }

    fn all(&mut self) -> Result<Condition> {
        let mut parts = vec![self.single()?];
        while self.take("&&") || self.take_word("and") {
            parts.push(self.single()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { Condition::All(parts) })
    }

    fn single(&mut self) -> Result<Condition> {
        self.check_depth(1)?;
        self.depth += 1;
        let condition = if self.take("!") || self.take_word("not") {
            let inner = self.single()?;
            if matches!(inner, Condition::Compare(..)) {
                self.check_depth(2)?;
            }
            Condition::Not(Box::new(inner))
        } else if self.take("(") {
            let inner = self.any()?;
            if !self.take(")") {
                return Err(self.fail("`)`"));
            }
            inner
        } else {
            self.comparison()?
        };
        self.depth -= 1;
        Ok(condition)
    }

    fn comparison(&mut self) -> Result<Condition> {
        let left = self.operand()?;
        if matches!(left, Operand::Column(_)) && self.begins_range() {
            return self.range(&left);
        }
        let relation = RELATIONS.into_iter().find(|(sign, _)| self.take(sign));
        let Some((_, relation)) = relation else {
            return Err(self.fail("==, !=, <, <=, > or >="));
        };
        let right = self.operand()?;
        let is_equality = matches!(relation, Relation::Equal | Relation::NotEqual);
        Ok(match (&left, &right) {
            (Operand::Column(column), Operand::Column(name)) if is_equality => {
                match (class_of(column, name), class_of(name, column)) {
                    (Some(class), _) => Condition::Compare(left, relation, class),
                    (_, Some(class)) => Condition::Compare(class, relation, right),
                    _ => Condition::Compare(left, relation, right),
                }
            }
            _ => Condition::Compare(left, relation, right),
        })
    }

    /// Returns true if the bounds of a range come next, or `!` before them.
    fn begins_range(&mut self) -> bool {
        ["[", "(", "![", "!("].into_iter().any(|sign| self.peek(sign))
    }

    /// Parses the bounds of a range: brackets include the bound, parentheses exclude it, and either may be absent. Behind
    /// `!` the range is what lies outside of them.
    fn range(&mut self, column: &Operand) -> Result<Condition> {
        if self.take("!") {
            let inside = self.range(column)?;
            self.check_depth(2)?;
            return Ok(Condition::Not(Box::new(inside)));
        }
        let above = if self.take("[") { Relation::GreaterOrEqual } else { Relation::Greater };
        self.take("(");
        let mut parts = Vec::new();
        if !self.peek(":") {
            parts.push(Condition::Compare(column.clone(), above, Operand::Number(self.number()?)));
        }
        if !self.take(":") {
            return Err(self.fail("`:` between the bounds of a range"));
        }
        let high = match self.peek("]") || self.peek(")") {
            true => None,
            false => Some(self.number()?),
        };
        let below = match (self.take("]"), self.take(")")) {
            (true, _) => Relation::LessOrEqual,
            (_, true) => Relation::Less,
            _ => return Err(self.fail("`]` or `)`")),
        };
        let bound = |high| Condition::Compare(column.clone(), below, Operand::Number(high));
        parts.extend(high.map(bound));
        if parts.is_empty() {
            return Err(self.fail("a range with a bound before it"));
        }
        self.check_depth(1)?;
        Ok(Condition::All(parts))
    }

    /// Fails unless so many more parentheses and negations are within the limit, as they are written back: around two
    /// bounds, and around what is negated.
    fn check_depth(&self, n_more: usize) -> Result<()> {
        if self.depth + n_more <= MAX_DEPTH { Ok(()) } else { Err(self.fail("fewer parentheses")) }
    }

    fn operand(&mut self) -> Result<Operand> {
        self.skip_spaces();
        let rest = self.rest();
        let is_name = |c: char| c.is_alphanumeric() || c == '_';
        if rest.starts_with(|c: char| c.is_alphabetic() || c == '_') {
            let end = rest.find(|c| !is_name(c)).unwrap_or(rest.len());
            self.at += end;
            return Ok(Operand::Column(rest[..end].to_owned()));
        }
        Ok(Operand::Number(self.number()?))
    }

    fn number(&mut self) -> Result<f64> {
        self.skip_spaces();
        let rest = self.rest();
        let is_part = |(i, c): &(usize, char)| {
            let follows_exponent = rest[..*i].ends_with(['e', 'E']);
            c.is_ascii_digit()
                || matches!(c, '.' | 'e' | 'E')
                || matches!(c, '+' | '-') && (*i == 0 || follows_exponent)
        };
        let length = rest.char_indices().take_while(is_part).count();
        let number = rest[..length].parse::<f64>().ok().filter(|number| number.is_finite());
        let number = number.ok_or_else(|| self.fail("the name of a column or a number"))?;
        self.at += length;
        Ok(number)
    }

    /// Skips `sign` if it comes next; returns true if it did.
    fn take(&mut self, sign: &str) -> bool {
        let is_next = self.peek(sign);
        if is_next {
            self.at += sign.len();
        }
        is_next
    }

    /// Skips `word` in any case if it comes next and ends there.
    fn take_word(&mut self, word: &str) -> bool {
        self.skip_spaces();
        let rest = self.rest();
        let Some(start) = rest.get(..word.len()) else { return false };
        let ends = !rest[word.len()..].starts_with(|c: char| c.is_alphanumeric() || c == '_');
        let is_next = start.eq_ignore_ascii_case(word) && ends;
        if is_next {
            self.at += word.len();
        }
        is_next
    }

    fn peek(&mut self, sign: &str) -> bool {
        self.skip_spaces();
        self.rest().starts_with(sign)
    }

    fn skip_spaces(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn fail(&self, expected: &'static str) -> Error {
        let rest = self.rest().trim_start();
        let found = match rest.split_whitespace().next() {
            Some(word) => format!("`{}`", word.chars().take(20).collect::<String>()),
            None => "the end".to_owned(),
        };
        let character = self.text[..self.text.len() - rest.len()].chars().count() + 1;
        Error::Filter { character, found, expected }
    }
}

/// Returns the number of the class of this name, if it is compared with the classification.
fn class_of(column: &str, name: &str) -> Option<Operand> {
    let is_class = KnownColumn::from_name(column) == Some(KnownColumn::Classification);
    let class = class_named(name).filter(|_| is_class)?;
    Some(Operand::Number(class.into()))
}

#[cfg(test)]
mod tests {
    //! Broken filters, and the place that their errors name.

    use super::*;

    #[test]
    fn broken_filters_are_rejected_with_their_place() {
        let message = |text: &str| parse(text).unwrap_err().to_string();
        assert_eq!(
            message("z = 3"),
            "filter, character 3: found `=`, expected ==, !=, <, <=, > or >="
        );
        assert!(message("").contains("found the end, expected the name of a column or a number"));
        assert!(message("z < 3 &&").contains("character 9: found the end"));
        assert!(message("z < 3 z > 4").contains("character 7: found `z`, expected &&, || or"));
        assert!(message("(z < 3").contains("expected `)`"));
        assert!(message("z[3]").contains("`:` between the bounds"));
        assert!(message("z[3:4").contains("`]` or `)`"));
        assert!(message("z[:]").contains("a range with a bound"));
        assert!(message("z[0:1], z < 3").contains("character 11: found `<`, expected a range as"));
        assert!(message("z[0:1],").contains("found the end"));
        assert!(message("z ! 3").contains("expected ==, !="));
        assert!(message("z < 1e999").contains("found `1e999`"));
        assert!(message(&"(".repeat(1000)).contains("fewer parentheses"));
        assert!(message(&"!".repeat(1000)).contains("fewer parentheses"));
    }

    #[test]
    fn the_deepest_conditions_are_written_back_readably() {
        for deepest in ["x == 1", "x[1:2]", "x[1:]"].map(|inner| "!".repeat(MAX_DEPTH - 2) + inner)
        {
            let written = parse(&deepest).unwrap().to_string();
            assert_eq!(parse(&written).unwrap().to_string(), written);
            assert!(parse(&format!("!{deepest}")).is_err());
        }
    }
}
