//! Bundling: the page's modules as one script, and its style sheets as one, so that it loads with few requests.
//!
//! Each module becomes a function that is called once and returns the module's exports. A module that another one loads
//! by `import('./name.js')` becomes a script of its own, with those that it alone imports; it is given the modules of the
//! first script that it imports, too. This understands the forms of `import` and `export` that the page uses, and rejects
//! all others; a test bundles the page. Lines that hold only a comment and indentation are left out, so that the page loads
//! sooner; texts of several lines have no indentation.

use std::collections::BTreeSet;

/// Reads a file of the page by its name.
pub type ReadFile<'r> = &'r dyn Fn(&str) -> Option<String>;

/// Returns one module that does what `entry` and all modules that it imports do. `add_script` gets the name and the text
/// of each script that is loaded when it is needed, and returns its address.
///
/// # Errors
///
/// Fails with the reason if a module is missing, imports itself through others, or uses another form of `import` or
/// `export`.
pub fn bundle_modules(
    entry: &str,
    read: ReadFile,
    add_script: &mut dyn FnMut(&str, String) -> String,
) -> Result<String, String> {
    let mut first = Bundle::new(read);
    first.add(entry)?;
    let mut text = first.text;
    for name in first.needed_later {
        let mut later = Bundle { given: Some(&first.is_added), ..Bundle::new(read) };
        later.add(&name)?;
        if let Some(other) = later.needed_later.first() {
            return Err(format!("{name}: loads {other}, although it is not in the first script"));
        }
        let given: Vec<String> = later.used.iter().map(|name| variable_of(name)).collect();
        let given = given.join(", ");
        let variable = variable_of(&name);
        let script = format!(
            "export default ({{ {given} }}) => {{\n{}return {variable};\n}};\n",
            later.text
        );
        let address = add_script(&name, script);
        let call = format!("import('./{address}').then((script) => script.default({{ {given} }}))");
        text = text.replace(&format!("import('./{name}')"), &call);
    }
    Ok(text)
}

/// Returns the style sheets in their order as one, without comments and needless spaces.
///
/// # Errors
///
/// Fails with the reason if one is missing.
pub fn bundle_styles(names: &[&str], read: ReadFile) -> Result<String, String> {
    let texts = names.iter().map(|name| read(name).ok_or_else(|| format!("{name}: is missing")));
    let texts = texts.collect::<Result<Vec<String>, String>>()?;
    Ok(dense_lines(&texts.concat()).map(dense_style).collect())
}

/// A line of a style sheet without the spaces that separate nothing. No text of a sheet has a colon or comma before a
/// space.
fn dense_style(line: &str) -> String {
    let line = line.trim().replace(": ", ":").replace(", ", ",").replace(" {", "{");
    let end = if line.ends_with([';', '{', '}', ',']) { "" } else { "\n" };
    line + end
}

struct Bundle<'r> {
    read: ReadFile<'r>,
    /// The modules of the first script, if this is another one.
    given: Option<&'r BTreeSet<String>>,
    /// Names of given modules that are imported.
    used: BTreeSet<String>,
    is_added: BTreeSet<String>,
    /// The modules whose imports are being added.
    open: Vec<String>,
    /// The modules that are loaded when they are needed.
    needed_later: BTreeSet<String>,
    text: String,
}

impl<'r> Bundle<'r> {
    fn new(read: ReadFile<'r>) -> Self {
        Self {
            read,
            given: None,
            used: BTreeSet::new(),
            is_added: BTreeSet::new(),
            open: Vec::new(),
            needed_later: BTreeSet::new(),
            text: String::new(),
        }
    }

    /// Adds a module after those that it imports.
    fn add(&mut self, name: &str) -> Result<(), String> {
        if self.given.is_some_and(|given| given.contains(name)) {
            self.used.insert(name.to_owned());
            return Ok(());
        }
        if self.is_added.contains(name) {
            return Ok(());
        }
        if self.open.iter().any(|open| open == name) {
            return Err(format!("{name}: imports itself through {}", self.open.join(", ")));
        }
        let text = (self.read)(name).ok_or_else(|| format!("{name}: is missing"))?;
        let module = Module::parse(&text).map_err(|error| format!("{name}: {error}"))?;
        self.open.push(name.to_owned());
        for import in &module.imports {
            self.add(&import.from)?;
        }
        self.open.pop();
        self.is_added.insert(name.to_owned());
        self.text += &module.as_function(name);
        self.needed_later.extend(module.needed_later);
        Ok(())
    }
}

/// One module: its imports, the names that it exports, and its text without `import` and `export`.
struct Module<'t> {
    imports: Vec<Import>,
    /// The names of the modules that it loads when it needs them.
    needed_later: Vec<String>,
    exports: Vec<&'t str>,
    lines: Vec<&'t str>,
}

struct Import {
    /// The name of the module that is imported.
    from: String,
    /// The name or the pattern that its exports are assigned to.
    target: String,
}

impl<'t> Module<'t> {
    fn parse(text: &'t str) -> Result<Self, String> {
        let mut module = Self {
            imports: Vec::new(),
            needed_later: Vec::new(),
            exports: Vec::new(),
            lines: Vec::new(),
        };
        let mut lines = dense_lines(text);
        while let Some(line) = lines.next() {
            let unsupported = || format!("`{line}` is not supported");
            if line.contains("import.meta") {
                return Err(unsupported());
            }
            for rest in line.split("import(").skip(1) {
                let name = rest.strip_prefix("'./").and_then(|rest| rest.split_once("')"));
                module.needed_later.push(name.ok_or_else(unsupported)?.0.to_owned());
            }
            if line.starts_with("import ") {
                let mut statement = line.to_owned();
                while !statement.ends_with(';') {
                    let next = lines.next().ok_or("an import does not end with a semicolon")?;
                    statement += next;
                }
                module.imports.push(Import::parse(&statement)?);
            } else if let Some(declaration) = line.strip_prefix("export") {
                let declaration = declaration.trim_start();
                let name = exported_name(declaration);
                module.exports.push(name.ok_or_else(unsupported)?);
                module.lines.push(declaration);
            } else {
                module.lines.push(line.trim());
            }
        }
        Ok(module)
    }

    fn as_function(&self, name: &str) -> String {
        let imports = self
            .imports
            .iter()
            .map(|Import { from, target }| format!("const {target} = {};\n", variable_of(from)));
        format!(
            "const {} = (() => {{\n{}{}\nreturn {{ {} }};\n}})();\n",
            variable_of(name),
            imports.collect::<String>(),
            self.lines.join("\n"),
            self.exports.join(", "),
        )
    }
}

impl Import {
    fn parse(statement: &str) -> Result<Self, String> {
        let parsed = || {
            let (names, from) = statement.strip_prefix("import ")?.split_once(" from './")?;
            let from = from.strip_suffix("';")?.to_owned();
            let names = names.trim();
            let target = match names.strip_prefix("* as ") {
                Some(name) => name.to_owned(),
                None if names.starts_with('{') => names.replace(" as ", ": "),
                None => return None,
            };
            Some(Self { from, target })
        };
        parsed().ok_or_else(|| format!("`{statement}` is not supported"))
    }
}

/// The lines of a text without those that are empty or hold only a comment.
fn dense_lines(text: &str) -> impl Iterator<Item = &str> {
    let mut is_in_comment = false;
    text.lines().filter(move |line| {
        let line = line.trim();
        // A comment before code stays.
        let begins =
            line.starts_with("/*") && line.find("*/").is_none_or(|end| end + 2 == line.len());
        let is_comment = is_in_comment || begins || line.starts_with("//");
        if begins || is_in_comment {
            is_in_comment = !line.contains("*/");
        }
        !is_comment && !line.is_empty()
    })
}

/// The name that a declaration declares; none if it is not a function, class or constant with a single name.
fn exported_name(declaration: &str) -> Option<&str> {
    let declaration = declaration.strip_prefix("async ").unwrap_or(declaration);
    let name =
        ["function ", "class ", "const "].iter().find_map(|kind| declaration.strip_prefix(kind))?;
    let is_part = |letter: char| letter.is_ascii_alphanumeric() || letter == '_' || letter == '$';
    let end = name.find(|letter| !is_part(letter)).unwrap_or(name.len());
    Some(&name[..end]).filter(|name| !name.is_empty())
}

/// The variable that holds the exports of a module.
fn variable_of(name: &str) -> String {
    let stem = name.strip_suffix(".js").unwrap_or(name);
    format!("module_{}", stem.replace(|letter: char| !letter.is_ascii_alphanumeric(), "_"))
}

#[cfg(test)]
mod tests {
    //! Modules of all supported forms, and those that are rejected.

    use super::*;

    /// The first script, then the others.
    fn bundle_all(files: &[(&str, &str)]) -> Result<Vec<String>, String> {
        let read = |name: &str| {
            let found = files.iter().find(|(found, _)| *found == name);
            found.map(|(_, text)| (*text).to_owned())
        };
        let mut scripts = Vec::new();
        let mut add_script = |name: &str, text: String| {
            scripts.push(text);
            format!("hashed-{name}")
        };
        let first = bundle_modules("main.js", &read, &mut add_script)?;
        scripts.insert(0, first);
        Ok(scripts)
    }

    fn bundle(files: &[(&str, &str)]) -> Result<String, String> {
        Ok(bundle_all(files)?.swap_remove(0))
    }

    #[test]
    fn modules_come_once_and_after_those_they_import() {
        let found = bundle(&[
            (
                "main.js",
                "import { one as first,\n  Two } from './a-b.js';\nimport * as c from './c.js';\nc.run(first);",
            ),
            (
                "a-b.js",
                "import { run } from './c.js';\nexport const one = run();\nexport class Two {}",
            ),
            (
                "c.js",
                "// Runs.\n\n/**\n * Returns.\n */\nexport async function run(x) {\n  /** Now. */\n  return x; // Later.\n}",
            ),
        ]);
        let expected = "\
const module_c = (() => {
async function run(x) {
return x; // Later.
}
return { run };
})();
const module_a_b = (() => {
const { run } = module_c;
const one = run();
class Two {}
return { one, Two };
})();
const module_main = (() => {
const { one: first,  Two } = module_a_b;
const c = module_c;
c.run(first);
return {  };
})();
";
        assert_eq!(found.unwrap(), expected);
    }

    #[test]
    fn modules_that_are_needed_later_are_scripts_of_their_own() {
        let found = bundle_all(&[
            ("main.js", "import { a } from './a.js';\nconst later = () => import('./late.js');"),
            ("a.js", "export const a = 1;"),
            (
                "late.js",
                "import { a } from './a.js';\nimport { b } from './b.js';\nexport const c = a + b;",
            ),
            ("b.js", "export const b = 2;"),
        ]);
        let [first, later] = found.unwrap().try_into().unwrap();
        let call = "import('./hashed-late.js').then((script) => script.default({ module_a }))";
        assert!(first.contains(&format!("const later = () => {call};")), "{first}");
        assert!(!first.contains("module_b"), "{first}");
        let expected = "\
export default ({ module_a }) => {
const module_b = (() => {
const b = 2;
return { b };
})();
const module_late = (() => {
const { a } = module_a;
const { b } = module_b;
const c = a + b;
return { c };
})();
return module_late;
};
";
        assert_eq!(later, expected);
    }

    #[test]
    fn style_sheets_are_joined_without_comments() {
        let read = |name: &str| match name {
            "a.css" => Some("/* All. */\n\nb {\n  color: red;\n}\n".to_owned()),
            "c.css" => Some("/* Two\n   lines. */\nd { top: 0; }\n".to_owned()),
            _ => None,
        };
        let found = bundle_styles(&["a.css", "c.css"], &read);
        assert_eq!(found.unwrap(), "b{color:red;}d{ top:0; }");
        assert!(bundle_styles(&["a.css", "e.css"], &read).unwrap_err().contains("e.css"));
    }

    #[test]
    fn other_forms_are_rejected() {
        for (text, expected) in [
            ("import './a.js';", "`import './a.js';`"),
            ("import a from './a.js';", "import a"),
            ("import { a } from 'https://a.example/a.js';", "a.example"),
            ("import { a } from './a.js'", "semicolon"),
            ("const a = await import(name);", "await import"),
            ("const a = await import('./a.js');", "a.js: is missing"),
            ("export default 3;", "export default"),
            ("export let a = 3;", "export let"),
            ("export { a };", "export { a }"),
            ("export const { a, b } = c;", "export const {"),
            ("import { a } from './a.js';", "a.js: is missing"),
            ("import { a } from './main.js';", "main.js: imports itself"),
        ] {
            let error = bundle(&[("main.js", text)]).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
