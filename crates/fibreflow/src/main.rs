//! Command line of `fibreflow`.
fn main() {}
