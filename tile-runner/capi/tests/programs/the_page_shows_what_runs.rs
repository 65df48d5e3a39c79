//! The programs that docs/c.md shows are those that the tests build, and it names every function.

use std::fs;

use crate::installed::package;

#[test]
fn the_page_shows_what_runs() {
    let page = fs::read_to_string(package().join("../../docs/c.md"))
        .unwrap()
        .replace("\r\n", "\n");
    for example in ["frame.c", "adaptive.c", "rows.c"] {
        let code = fs::read_to_string(package().join("examples").join(example))
            .unwrap()
            .replace("\r\n", "\n");
        assert!(
            page.contains(&format!("```c\n{code}```")),
            "docs/c.md does not show examples/{example} as it is"
        );
    }
    let header = fs::read_to_string(package().join("include/linpred.h")).unwrap();
    for line in header
        .lines()
        .filter(|line| !line.starts_with([' ', '/', '#']))
    {
        let name = line
            .split('(')
            .next()
            .and_then(|start| start.rsplit([' ', '*']).next());
        if let Some(name) = name.filter(|name| line.contains('(') && name.starts_with("linpred_")) {
            assert!(page.contains(name), "docs/c.md does not name {name}");
        }
    }
}
