//! The docstrings of the Python classes and functions, from the type stub that documents them.
//!
//! `python/ipm_rs/_core.pyi` is read by editors, mypy and the manual. With the feature `python`, this script writes each
//! of its docstrings to a file `help/NAME.txt` or `help/CLASS.NAME.txt` of OUT_DIR, which the binding includes, so that
//! `help()` says the same. The parser knows as much of Python as the stub uses, and stops at what it does not know.

use std::collections::BTreeMap;
use std::path::Path;
use std::{env, fs};

const STUB: &str = "python/ipm_rs/_core.pyi";
const QUOTES: &str = "\"\"\"";

fn main() -> Result<(), String> {
    announce("build.rs");
    if env::var_os("CARGO_FEATURE_PYTHON").is_none() {
        return Ok(());
    }
    announce(STUB);
    let stub = fs::read_to_string(STUB).map_err(|error| format!("{STUB}: {error}"))?;
    let out = env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR for build scripts")?;
    let folder = Path::new(&out).join("help");
    write_all(&folder, &docstrings(&stub)?).map_err(|error| format!("{}: {error}", folder.display()))
}

fn announce(file: &str) {
    println!("cargo::rerun-if-changed={file}");
}

/// A file for each docstring, and none of an earlier run.
fn write_all(folder: &Path, docstrings: &BTreeMap<String, String>) -> std::io::Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    fs::create_dir_all(folder)?;
    docstrings.iter().try_for_each(|(name, text)| fs::write(folder.join(format!("{name}.txt")), text))
}

/// The docstrings of classes, their members and functions, by name.
///
/// The text of a constructor follows that of its class: nothing shows the docstring of a compiled class's `__new__`.
fn docstrings(stub: &str) -> Result<BTreeMap<String, String>, String> {
    let mut found = BTreeMap::new();
    let mut class = None;
    let mut lines = stub.lines().enumerate().peekable();
    while let Some((number, line)) = lines.next() {
        let fail = |what: &str| Err(format!("{STUB}:{}: {what}", number + 1));
        let text = line.trim_start_matches(' ');
        let indent = line.len() - text.len();
        let Some((is_class, name)) = definition(text) else {
            if indent == 0 && !text.is_empty() && !text.starts_with([')', '@']) {
                class = None; // a statement of the module ends a class
            }
            continue;
        };
        let name = match (is_class, indent, &class) {
            (true, 0, _) => {
                class = Some(name.to_owned());
                name.to_owned()
            }
            (false, 0, _) => {
                class = None;
                name.to_owned()
            }
            (false, 4, Some(class)) => format!("{class}.{name}"),
            _ => return fail("expected classes and functions of the module, and functions of a class, 4 spaces deep"),
        };
        let mut header = text.to_owned();
        while depth(&header) > 0 {
            let Some((_, line)) = lines.next() else { return fail("the brackets of this definition are not closed") };
            header.push_str(line);
        }
        if !header.ends_with(':') || !lines.peek().is_some_and(|(_, line)| line.trim_start().starts_with(QUOTES)) {
            continue; // no docstring, as an overload after the first
        }
        let mut raw = String::new();
        for (_, line) in lines.by_ref() {
            raw.push_str(line);
            raw.push('\n');
            if raw.matches(QUOTES).count() == 2 {
                break;
            }
        }
        let Some(body) = raw.trim().strip_prefix(QUOTES).and_then(|body| body.strip_suffix(QUOTES)) else {
            return fail("expected a docstring between triple quotes with nothing after it");
        };
        if body.contains(['\\', '\t', '\0']) {
            return fail("a docstring holds no backslash and no tab: they are not translated here");
        }
        if found.insert(name, clean(body)).is_some() {
            return fail("a second docstring for this name; of overloads the first alone has one");
        }
    }
    with_constructors(found)
}

/// Whether a line defines a class, and the name that it defines.
fn definition(text: &str) -> Option<(bool, &str)> {
    let (is_class, rest) = match (text.strip_prefix("class "), text.strip_prefix("def ")) {
        (Some(rest), _) => (true, rest),
        (_, Some(rest)) => (false, rest),
        _ => return None,
    };
    let end = rest.find(|letter: char| !letter.is_alphanumeric() && letter != '_')?;
    Some((is_class, &rest[..end]))
}

/// How many brackets are open at the end.
fn depth(header: &str) -> usize {
    header.matches(['(', '[', '{']).count().saturating_sub(header.matches([')', ']', '}']).count())
}

/// As `inspect.cleandoc`: no common indentation, no empty lines around.
fn clean(body: &str) -> String {
    let indent = |line: &str| line.len() - line.trim_start().len();
    let margin = body.lines().skip(1).filter(|line| !line.trim().is_empty()).map(indent).min().unwrap_or(0);
    let first = body.lines().take(1).map(str::trim_start);
    let rest = body.lines().skip(1).map(|line| line.get(margin..).unwrap_or("").trim_end());
    first.chain(rest).collect::<Vec<_>>().join("\n").trim().to_owned()
}

fn with_constructors(mut found: BTreeMap<String, String>) -> Result<BTreeMap<String, String>, String> {
    let constructors: Vec<_> =
        found.keys().filter_map(|name| name.strip_suffix(".__new__").map(str::to_owned)).collect();
    for class in constructors {
        let constructor = found.remove(&format!("{class}.__new__")).unwrap_or_default();
        let text = found.get_mut(&class).ok_or(format!("{STUB}: class {class} has no docstring, its __new__ has"))?;
        *text = format!("{text}\n\n{constructor}");
    }
    Ok(found)
}
