//! Modules: each uses only those that `lib.rs` declares above it, the files of a folder use each other in one
//! direction, and an import names one module.

use crate::source::Crate;
use crate::source::ident;
use crate::source::is_punct;
use crate::source::line;
use crate::source::without_tests;
use proc_macro2::Delimiter;
use proc_macro2::TokenTree;
use std::collections::BTreeMap;
use std::collections::BTreeSet;
use std::slice;

/// Names from the crate's root to a module; empty for the root.
type ModulePath = Vec<String>;

/// A path as it stands in a file, `super::node::Node` for instance.
#[derive(Clone, Debug)]
struct Mention {
    names: Vec<String>,
    line: usize,
}

/// One name that a `use` brings into a module.
#[derive(Debug)]
struct Import {
    mention: Mention,
    /// The name under which the module has it: the last one, or the one after `as`.
    name: String,
}

/// A module, be it a file or inline.
#[derive(Debug, Default)]
struct Module {
    file: String,
    children: Vec<String>,
    imports: Vec<Import>,
    /// Paths that begin with `crate`, `super` or `self`, outside of imports.
    inline: Vec<Mention>,
}

/// The modules of one crate without those for tests.
struct ModuleTree {
    modules: BTreeMap<ModulePath, Module>,
}

/// One module mentions another.
struct Use {
    from: ModulePath,
    to: ModulePath,
    /// File, line and path of the mention.
    witness: String,
}

/// Lists uses of modules that `lib.rs` declares below the one that uses them.
pub fn upward_uses(crates: &[Crate]) -> Vec<String> {
    let mut found = Vec::new();
    for source in crates {
        let tree = ModuleTree::new(source);
        let Some(root) = tree.modules.get(&Vec::new()) else { continue };
        let order = |path: &ModulePath| {
            path.first().and_then(|name| root.children.iter().position(|child| child == name))
        };
        for Use { from, to, witness } in tree.uses() {
            if let (Some(user), Some(used)) = (order(&from), order(&to))
                && user < used
            {
                let [user, used] = [user, used].map(|i| &root.children[i]);
                found.push(format!("{witness}: `{user}` stands above `{used}` in lib.rs"));
            }
        }
    }
    found
}

/// Lists the cycles among the files and folders of each folder, each with one witness for every step.
pub fn cycles(crates: &[Crate]) -> Vec<String> {
    let mut found = Vec::new();
    for source in crates {
        // By folder and by the two entries of it.
        let mut folders: BTreeMap<ModulePath, BTreeMap<(String, String), String>> = BTreeMap::new();
        for Use { from, to, witness } in ModuleTree::new(source).uses() {
            let n_common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if let (Some(user), Some(used)) = (from.get(n_common), to.get(n_common)) {
                let edges = folders.entry(from[..n_common].to_vec()).or_default();
                edges.entry((user.clone(), used.clone())).or_insert(witness);
            }
        }
        for (folder, edges) in folders {
            let edges_of_cycles = edges.iter().filter(|((from, to), _)| reaches(&edges, to, from));
            for ((from, to), witness) in edges_of_cycles {
                let folder = [slice::from_ref(&source.name), &folder[..]].concat().join("::");
                found.push(format!("{witness}: `{from}` and `{to}` of {folder} are in a cycle"));
            }
        }
    }
    found
}

/// Whether a walk along the edges leads from one entry of a folder to another.
fn reaches(edges: &BTreeMap<(String, String), String>, from: &str, to: &str) -> bool {
    let (mut open, mut seen) = (vec![from], BTreeSet::from([from]));
    while let Some(entry) = open.pop() {
        if entry == to {
            return true;
        }
        let next = edges.keys().filter(|(user, _)| user == entry).map(|(_, used)| used.as_str());
        open.extend(next.filter(|used| seen.insert(used)));
    }
    false
}

/// Lists imports that name more than one module.
pub fn crowded_imports(crates: &[Crate]) -> Vec<String> {
    let trees: BTreeMap<&str, ModuleTree> =
        crates.iter().map(|source| (source.name.as_str(), ModuleTree::new(source))).collect();
    let mut found = Vec::new();
    for source in crates {
        for file in &source.files {
            for import in imports(&file.tokens) {
                let module =
                    file.module.as_ref().map(|module| (&trees[source.name.as_str()], module));
                if import.has_nested_path || 1 < n_modules(&import, module, &trees) {
                    found.push(format!(
                        "{}:{}: an import of several modules",
                        file.path, import.line
                    ));
                }
            }
        }
    }
    found
}

/// The number of names in the braces of an import that are modules.
fn n_modules(
    import: &UseItem,
    module: Option<(&ModuleTree, &ModulePath)>,
    trees: &BTreeMap<&str, ModuleTree>,
) -> usize {
    let is_module = |names: &Vec<String>| match names[0].as_str() {
        "std" | "core" | "alloc" => names.len() == 2 && names[1].starts_with(char::is_lowercase),
        "crate" | "super" | "self" => module.is_some_and(|(tree, from)| {
            tree.absolute(from, names).is_some_and(|path| tree.is_module(&path))
        }),
        name => trees.get(name).is_some_and(|tree| tree.is_module(&names[1..])),
    };
    import.leaves.iter().filter(|(names, _)| is_module(names)).count()
}

impl ModuleTree {
    fn new(source: &Crate) -> Self {
        let mut modules = BTreeMap::new();
        for file in &source.files {
            if let Some(path) = &file.module {
                scan_module(&file.tokens, &file.path, path, &mut modules);
            }
        }
        // Files of modules that only tests declare go.
        let declared = |path: &ModulePath| {
            (0..path.len()).all(|i| {
                let parent: Option<&Module> = modules.get(&path[..i]);
                parent.is_some_and(|parent| parent.children.contains(&path[i]))
            })
        };
        let kept: BTreeSet<ModulePath> =
            modules.keys().filter(|path| declared(path)).cloned().collect();
        modules.retain(|path, _| kept.contains(path));
        Self { modules }
    }

    /// Whether a path from the root names a module, and not also a function that its parent re-exports.
    fn is_module(&self, path: &[String]) -> bool {
        let is_reexported = path.split_last().is_some_and(|(name, parent)| {
            let parent = self.modules.get(parent);
            parent.is_some_and(|parent| parent.imports.iter().any(|import| import.name == *name))
        });
        self.modules.contains_key(path) && !is_reexported
    }

    /// All uses of one module by another within the crate.
    fn uses(&self) -> Vec<Use> {
        let mut uses = Vec::new();
        for (from, module) in &self.modules {
            let imports = module.imports.iter().map(|import| &import.mention);
            for mention in imports.chain(&module.inline) {
                if let Some(to) = self.definition(from, &mention.names, 8) {
                    let (line, names) = (mention.line, mention.names.join("::"));
                    let witness = format!("{}:{line}: {names}", module.file);
                    uses.push(Use { from: from.clone(), to, witness });
                }
            }
        }
        uses
    }

    /// The path from the root of what is named in a module, or `None` if it comes from another crate.
    fn absolute(&self, from: &[String], names: &[String]) -> Option<Vec<String>> {
        let mut path = match names[0].as_str() {
            "crate" => Vec::new(),
            "self" | "super" => from.to_vec(),
            child if self.modules.get(from)?.children.iter().any(|name| name == child) => {
                return Some([from, names].concat());
            }
            _ => return None,
        };
        for name in names {
            match name.as_str() {
                "crate" | "self" => {}
                "super" => drop(path.pop()),
                name => path.push(name.to_owned()),
            }
        }
        Some(path)
    }

    /// The module that defines what is named, with re-exports followed up to a depth.
    fn definition(&self, from: &[String], names: &[String], depth: u32) -> Option<ModulePath> {
        let path = self.absolute(from, names)?;
        let n_known = (0..=path.len()).rev().find(|&n| self.modules.contains_key(&path[..n]))?;
        let (module, rest) = path.split_at(n_known);
        let Some(name) = rest.first() else { return Some(path) };
        let mut imports = self.modules[module].imports.iter();
        let import = imports.find(|import| import.name == *name);
        let followed = import.filter(|_| 0 < depth).and_then(|import| {
            let names = [&import.mention.names, &rest[1..]].concat();
            self.definition(module, &names, depth - 1)
        });
        Some(followed.unwrap_or_else(|| module.to_vec()))
    }
}

fn scan_module(
    tokens: &[TokenTree],
    file: &str,
    path: &[String],
    modules: &mut BTreeMap<ModulePath, Module>,
) {
    let mut module = Module { file: file.to_owned(), ..Module::default() };
    scan(tokens, path, &mut module, modules);
    modules.insert(path.to_vec(), module);
}

/// Collects what the tokens of a module declare, import and mention, without what is for tests.
fn scan(
    tokens: &[TokenTree],
    path: &[String],
    module: &mut Module,
    modules: &mut BTreeMap<ModulePath, Module>,
) {
    let tokens = without_tests(tokens);
    let mut rest = &tokens[..];
    while let [first, later @ ..] = rest {
        rest = later;
        match (ident(first).as_deref(), later) {
            (Some("mod"), [name, TokenTree::Group(body), ..]) => {
                let Some(name) = ident(name) else { continue };
                let body: Vec<TokenTree> = body.stream().into_iter().collect();
                scan_module(&body, &module.file, &[path, slice::from_ref(&name)].concat(), modules);
                module.children.push(name);
                rest = &later[2..];
            }
            (Some("mod"), [name, end, ..]) if is_punct(end, ';') => {
                module.children.extend(ident(name));
            }
            (Some("pub"), [TokenTree::Group(scope), ..])
                if scope.delimiter() == Delimiter::Parenthesis =>
            {
                rest = &later[1..];
            }
            (Some("use"), _) => {
                let Some(item) = use_item(first, later) else { continue };
                module.imports.extend(item.leaves.into_iter().map(|(names, name)| Import {
                    mention: Mention { names, line: item.line },
                    name,
                }));
                let end = later.iter().position(|token| is_punct(token, ';'));
                rest = &later[end.unwrap_or(0)..];
            }
            (Some("crate" | "super" | "self"), _) => {
                let (names, n_tokens) = plain_path(rest_with(first, later).as_slice());
                if 1 < names.len() {
                    module.inline.push(Mention { names, line: line(first) });
                }
                rest = &later[n_tokens - 1..];
            }
            _ => {}
        }
        if let TokenTree::Group(group) = first {
            scan(&group.stream().into_iter().collect::<Vec<_>>(), path, module, modules);
        }
    }
}

fn rest_with(first: &TokenTree, later: &[TokenTree]) -> Vec<TokenTree> {
    // No path of this workspace has more than sixteen names.
    [first].into_iter().chain(later.iter().take(48)).cloned().collect()
}

/// The names of `a::b::c` at the beginning of tokens, and the number of tokens that they take.
fn plain_path(tokens: &[TokenTree]) -> (Vec<String>, usize) {
    let mut names: Vec<String> = tokens.first().and_then(ident).into_iter().collect();
    let mut n_tokens = names.len();
    while let [a, b, name, ..] = &tokens[n_tokens..] {
        let Some(name) = ident(name).filter(|_| is_punct(a, ':') && is_punct(b, ':')) else {
            break;
        };
        names.push(name);
        n_tokens += 3;
    }
    (names, n_tokens)
}

/// One `use` with all that it names.
struct UseItem {
    line: usize,
    /// The full path of each name with the name that it has here.
    leaves: Vec<(Vec<String>, String)>,
    /// Whether something within braces is a path itself.
    has_nested_path: bool,
}

/// All imports of a file, also those within functions and modules for tests.
fn imports(tokens: &[TokenTree]) -> Vec<UseItem> {
    let mut found = Vec::new();
    for (i, token) in tokens.iter().enumerate() {
        if ident(token).as_deref() == Some("use") {
            found.extend(use_item(token, &tokens[i + 1..]));
        }
        if let TokenTree::Group(group) = token {
            found.extend(imports(&group.stream().into_iter().collect::<Vec<_>>()));
        }
    }
    found
}

/// The import whose `use` stands before `tokens`; `None` for the `use<'a>` of a type.
fn use_item(keyword: &TokenTree, tokens: &[TokenTree]) -> Option<UseItem> {
    let end = tokens.iter().position(|token| is_punct(token, ';'))?;
    let mut item = UseItem { line: line(keyword), leaves: Vec::new(), has_nested_path: false };
    if tokens.first().is_some_and(|token| is_punct(token, '<')) {
        return None;
    }
    add_leaves(&tokens[..end], &[], &mut item);
    Some(item)
}

fn add_leaves(tokens: &[TokenTree], prefix: &[String], item: &mut UseItem) {
    for branch in tokens.split(|token| is_punct(token, ',')) {
        let (names, n_tokens) = plain_path(branch);
        if names.is_empty() {
            // This is what follows the last comma, or a variable of a macro.
            continue;
        }
        item.has_nested_path |= !prefix.is_empty() && (1 < names.len() || 1 < n_tokens);
        let is_self = names.first().is_some_and(|name| name == "self") && !prefix.is_empty();
        let names = [prefix, if is_self { &[] } else { &names }].concat();
        match branch.get(n_tokens..).unwrap_or_default() {
            [.., TokenTree::Group(group)] => {
                item.has_nested_path |= !prefix.is_empty();
                add_leaves(&group.stream().into_iter().collect::<Vec<_>>(), &names, item);
            }
            [.., star] if is_punct(star, '*') => item.leaves.push((names, "*".to_owned())),
            [.., alias] => item.leaves.extend(ident(alias).map(|alias| (names, alias))),
            [] => {
                let last = names.last().cloned();
                item.leaves.extend(last.map(|last| (names, last)));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Upward uses, cycles and imports of several modules are found in made-up crates.

    use super::*;
    use crate::source::crate_of;

    fn demo(files: &[(&str, &str)]) -> Vec<Crate> {
        vec![crate_of("demo", files.iter().copied())]
    }

    #[test]
    fn uses_of_modules_declared_below_are_found() {
        let files = |math: &'static str| {
            demo(&[
                ("src/lib.rs", "mod math; mod scene; mod error; pub use error::Error;"),
                ("src/math/mod.rs", "mod ray;"),
                ("src/math/ray.rs", math),
                ("src/scene.rs", "use crate::math::Ray; use super::math;"),
                ("src/error.rs", ""),
            ])
        };
        assert!(upward_uses(&files("use super::Aabb; pub struct Ray;")).is_empty());
        for upward in [
            "use crate::scene::Scene;",
            "use crate::{scene::Scene};",
            "use super::super::scene;",
            "fn a() { let b = crate::scene::b(); }",
            "fn a() -> Result<u8, crate::Error> {}",
            "macro_rules! a { () => { $crate::scene::b() }; }",
        ] {
            let found = upward_uses(&files(upward));
            assert_eq!(found.len(), 1, "{upward}: {found:?}");
            assert!(found[0].starts_with("crates/demo/src/math/ray.rs:1: "), "{found:?}");
        }
        let of_tests = "#[cfg(test)] mod tests { use crate::scene::Scene; }";
        assert!(upward_uses(&files(of_tests)).is_empty());
    }

    #[test]
    fn cycles_between_files_of_a_folder_are_found() {
        let files = |a: &'static str, b: &'static str, c: &'static str| {
            demo(&[
                ("src/lib.rs", "mod tree;"),
                ("src/tree/mod.rs", "mod a; mod b; mod c; #[cfg(test)] mod tests; pub use b::B;"),
                ("src/tree/a.rs", a),
                ("src/tree/b.rs", b),
                ("src/tree/c.rs", c),
                ("src/tree/tests.rs", "use super::a; use super::b;"),
            ])
        };
        assert!(cycles(&files("use super::b::B;", "use crate::tree::c::C;", "")).is_empty());
        let found = cycles(&files("use super::B;", "", "use super::a::A;"));
        assert!(found.is_empty(), "{found:?}");
        for (a, b, c, n) in [
            ("use super::b::B;", "use super::a::A;", "", 2),
            ("use super::B;", "fn b() { super::a::b() }", "", 2),
            ("use super::b;", "use super::c;", "use crate::tree::a;", 3),
        ] {
            let found = cycles(&files(a, b, c));
            assert_eq!(found.len(), n, "{found:?}");
            assert!(found.iter().all(|line| line.contains("demo::tree are in a cycle")));
        }
    }

    #[test]
    fn imports_of_several_modules_are_found() {
        for (text, is_found) in [
            ("use crate::{a, b};", true),
            ("use crate::a::{A, deep::B};", true),
            ("use crate::{a::A};", true),
            ("use crate::a::{self, deep};", true),
            ("fn f() { use std::{fs, io}; }", true),
            ("#[cfg(test)] mod tests { use demo::{a, b}; }", true),
            ("use crate::a::{self, A, f};", false),
            ("use std::io::{self, Write};", false),
            ("use demo::{a, c};", false),
            ("use demo::{a, b, c};", true),
            ("use crate::a;\nuse crate::b as c;", false),
            ("macro_rules! m { ($path:path) => { use $path; use $path::{x, y}; } }", false),
            ("fn f<'a>() -> impl Fn() + use<'a> {}", false),
        ] {
            let files = [
                ("src/lib.rs", "mod a; mod b; mod c; pub use c::c;"),
                ("src/c.rs", "pub fn c() {}"),
                ("src/a/mod.rs", "mod deep; pub fn f() {}"),
                ("src/a/deep.rs", ""),
                ("src/b.rs", text),
            ];
            assert_eq!(crowded_imports(&demo(&files)).len(), usize::from(is_found), "{text}");
        }
    }
}
