//! The crate's public interface, as a list in `snapshots/public-api.snap`: what another program may use.

use quote::ToTokens;
use std::collections::BTreeSet;
use std::fs::read_to_string;
use std::path::Path;
use syn::{Fields, ImplItem, Item, Signature, UseTree, Visibility};

/// The files in which the items are that `harness/drivebench/src/lib.rs` re-exports.
const FILES: [&str; 6] = [
    "proto/src/nd21/state.rs",
    "drivebench/src/embed/drives.rs",
    "bench/src/embed.rs",
    "drivebench/src/embed/scenario.rs",
    "drivebench/src/embed/served.rs",
    "bench/src/scenario/verdict.rs",
];

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

fn items(file: &str) -> Vec<Item> {
    let text = read_to_string(root().join("harness").join(file)).expect("a file");
    syn::parse_file(&text).expect("Rust").items
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

/// Whether an item is left out of the documentation.
fn is_hidden(attributes: &[syn::Attribute]) -> bool {
    attributes
        .iter()
        .any(|one| one.to_token_stream().to_string() == "# [doc (hidden)]")
}

/// The names that a `use` brings.
fn names(tree: &UseTree, into: &mut BTreeSet<String>) {
    match tree {
        UseTree::Path(path) => names(&path.tree, into),
        UseTree::Name(name) => {
            into.insert(name.ident.to_string());
        }
        UseTree::Rename(rename) => {
            into.insert(rename.rename.to_string());
        }
        UseTree::Group(group) => group.items.iter().for_each(|tree| names(tree, into)),
        UseTree::Glob(_) => panic!("a glob cannot be listed: export its items by their names"),
    }
}

fn text(tokens: &impl ToTokens) -> String {
    let spaced = tokens.to_token_stream().to_string();
    let pairs = [
        (" :: ", "::"),
        (" < ", "<"),
        (" >", ">"),
        (" ,", ","),
        (" :", ":"),
        ("& ", "&"),
        (" (", "("),
        ("( ", "("),
        (" )", ")"),
        ("- >", "->"),
        (">(", "> ("),
        ("' _", "'_"),
    ];
    pairs
        .iter()
        .fold(spaced, |text, (from, to)| text.replace(from, to))
}

fn signature(name: &str, signature: &Signature) -> String {
    let shown = text(signature);
    format!("{name}::{}", shown.trim_start_matches("fn "))
}

/// The public lines of one type: itself, its variants and fields, its methods, and the traits that it has.
fn lines_of(name: &str, items: &[Item]) -> Vec<String> {
    let mut lines = Vec::new();
    let fields = |lines: &mut Vec<String>, owner: &str, fields: &Fields, all: bool| {
        for (index, field) in fields.iter().enumerate() {
            let name = field
                .ident
                .as_ref()
                .map_or(index.to_string(), ToString::to_string);
            if all || is_public(&field.vis) {
                lines.push(format!("{owner}.{name}: {}", text(&field.ty)));
            }
        }
    };
    for item in items {
        match item {
            Item::Struct(item) if item.ident == name => {
                lines.push(format!("struct {name}"));
                fields(&mut lines, name, &item.fields, false);
            }
            Item::Enum(item) if item.ident == name => {
                lines.push(format!("enum {name}"));
                for variant in &item.variants {
                    let owner = format!("{name}::{}", variant.ident);
                    lines.push(owner.clone());
                    fields(&mut lines, &owner, &variant.fields, true);
                }
            }
            Item::Impl(block) if text(&block.self_ty).split('<').next() == Some(name) => {
                if let Some((_, path, _)) = &block.trait_ {
                    lines.push(format!("{name}: {}", text(path)));
                    continue;
                }
                for item in &block.items {
                    match item {
                        ImplItem::Fn(function)
                            if is_public(&function.vis) && !is_hidden(&function.attrs) =>
                        {
                            lines.push(signature(name, &function.sig));
                        }
                        ImplItem::Const(constant) if is_public(&constant.vis) => {
                            let shown = text(&constant.ty);
                            lines.push(format!("{name}::{}: {shown}", constant.ident));
                        }
                        _ => {}
                    }
                }
            }
            _ => {}
        }
    }
    lines
}

#[test]
fn the_public_interface_is_the_list() {
    let mut exported = BTreeSet::new();
    for item in items("drivebench/src/lib.rs") {
        match &item {
            Item::Use(item) if is_public(&item.vis) && !is_hidden(&item.attrs) => {
                names(&item.tree, &mut exported)
            }
            Item::Mod(module) => assert!(
                !is_public(&module.vis) || is_hidden(&module.attrs),
                "the module {} is public: hide it, or list what is in it",
                module.ident
            ),
            _ => {}
        }
    }
    let all: Vec<Item> = FILES.iter().flat_map(|file| items(file)).collect();
    let mut shown = String::new();
    for name in &exported {
        let mut lines = lines_of(name, &all);
        // The type itself in front of what is implemented for it in other files.
        lines.sort_by_key(|line| line.contains(':'));
        assert!(
            lines
                .first()
                .is_some_and(|line| line.ends_with(name.as_str())),
            "{name} is exported, and none of {FILES:?} has it"
        );
        shown += &format!("{}\n", lines.join("\n"));
    }
    insta::with_settings!({
        snapshot_path => root().join("snapshots"),
        prepend_module_to_snapshot => false,
        omit_expression => true,
    }, {
        insta::assert_snapshot!("public-api", shown);
    });
}
