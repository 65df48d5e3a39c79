//! The committed header is what cbindgen makes of the sources. To renew it: `LINPRED_RENEW=1 cargo test -p linpred-capi --test header_is_made_of_the_sources`.

use std::fs;
use std::path::Path;

#[test]
fn the_header_is_made_of_the_sources() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).unwrap();
    let builder = cbindgen::Builder::new()
        .with_config(config)
        .with_src(root.join("src/lib.rs"));
    let mut made = Vec::new();
    builder.generate().unwrap().write(&mut made);
    let made = String::from_utf8(made).unwrap();
    let header = root.join("include/linpred.h");
    if std::env::var_os("LINPRED_RENEW").is_some() {
        fs::write(&header, &made).unwrap();
    }
    let committed = fs::read_to_string(&header)
        .unwrap_or_default()
        .replace("\r\n", "\n");
    if let Some((n, (is, should))) = (1..)
        .zip(committed.lines().zip(made.lines()))
        .find(|(_, (is, should))| is != should)
    {
        panic!(
            "include/linpred.h, line {n}, is\n{is}\nand should be\n{should}\n(LINPRED_RENEW=1 writes it anew)"
        );
    }
    assert!(
        committed == made,
        "include/linpred.h has another length (LINPRED_RENEW=1 writes it anew)"
    );
}
