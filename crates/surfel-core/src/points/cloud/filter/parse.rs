//! Parses conditions: comparisons joined by `&&`, `||`, `!` and parentheses, and PDAL's ranges.

use super::condition::{Condition, Operand, RELATIONS, Relation};
use crate::error::{Error, Result};

/// Maximum depth of parentheses and negations, far below what the stack takes.
const MAX_DEPTH: usize = 100;

/// Parses a condition.
pub(super) fn parse(text: &str) -> Result<Condition> {
    let mut parser = Parser { text, at: 0, depth: 0 };
    let condition = parser.any()?;
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
        self.depth += 1;
        if MAX_DEPTH < self.depth {
            return Err(self.fail("fewer parentheses"));
        }
        let condition = if self.take("!") || self.take_word("not") {
            Condition::Not(Box::new(self.single()?))
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
        if matches!(left, Operand::Column(_)) && (self.peek("[") || self.peek("(")) {
            return self.range(&left);
        }
        let relation = RELATIONS.into_iter().find(|(sign, _)| self.take(sign));
        let Some((_, relation)) = relation else {
            return Err(self.fail("==, !=, <, <=, > or >="));
        };
        Ok(Condition::Compare(left, relation, self.operand()?))
    }

    /// Parses the bounds of a range: brackets include the bound, parentheses exclude it, and either may be absent.
    fn range(&mut self, column: &Operand) -> Result<Condition> {
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
        // Two bounds are written back in parentheses.
        if self.depth == MAX_DEPTH {
            return Err(self.fail("fewer parentheses"));
        }
        Ok(Condition::All(parts))
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
        assert!(message("z < 1e999").contains("found `1e999`"));
        assert!(message(&"(".repeat(1000)).contains("fewer parentheses"));
        assert!(message(&"!".repeat(1000)).contains("fewer parentheses"));
    }

    #[test]
    fn the_deepest_conditions_are_written_back_readably() {
        for deepest in ["!".repeat(MAX_DEPTH - 1) + "x == 1", "!".repeat(MAX_DEPTH - 2) + "x[1:2]"]
        {
            let written = parse(&deepest).unwrap().to_string();
            assert_eq!(parse(&written).unwrap().to_string(), written);
            assert!(parse(&format!("!{deepest}")).is_err());
        }
    }
}
