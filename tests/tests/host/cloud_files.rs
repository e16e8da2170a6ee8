//! Attributes of points in cloud files: docs/data.md has the table that the writer uses.

use std::fs;
use std::path::Path;

use echoloop_clouds::NumberType;
use echoloop_clouds::attribute::{ATTRIBUTES, Attribute};

fn row(attribute: &Attribute) -> String {
    let kind = match attribute.kind {
        NumberType::U8 => "uint8",
        NumberType::U16 => "uint16",
        NumberType::F32 => "float32",
        other => panic!("{other:?}: a kind that no page names yet"),
    };
    let unit = match attribute.unit {
        "" => String::new(),
        unit => format!("{unit} "),
    };
    format!("| `{}` | `{kind}` | {unit}| {} |\n", attribute.name, attribute.what)
}

#[test]
fn the_page_names_every_attribute_as_it_is_written_and_in_its_order() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/data.md");
    let page = fs::read_to_string(page).expect("docs/data.md");
    let rows: String = ATTRIBUTES.iter().map(row).collect();
    let head = "| name | type | unit | what |\n|---|---|---|---|\n";
    assert!(page.contains(&format!("{head}{rows}\n")), "expected the table\n{head}{rows}");
}
