//! Tables between markers in a page of text: the rest of the page is people's.

use std::io::Write as _;
use std::path::Path;

use crate::Error;

/// Replaces what stands between the markers of `name` in `page`.
///
/// The markers are lines of their own: `<!-- begin: name -->` and `<!-- end: name -->`.
///
/// # Errors
/// The markers are not there, in this order.
pub fn replace(page: &str, name: &str, content: &str) -> Result<String, Error> {
    let (begin, end) = (format!("<!-- begin: {name} -->"), format!("<!-- end: {name} -->"));
    let fault = || Error::Markers { page: head(page), begin: begin.clone(), end: end.clone() };
    let from = page.find(&begin).ok_or_else(fault)? + begin.len();
    let to = from + page[from..].find(&end).ok_or_else(fault)?;
    Ok(format!("{}\n\n{}\n\n{}", &page[..from], content.trim(), &page[to..]))
}

/// Replaces what stands between the markers of `name` in the file `page`.
///
/// # Errors
/// The file cannot be read or written, or has no such markers.
pub fn rewrite(page: &Path, name: &str, content: &str) -> Result<(), Error> {
    let text = std::fs::read_to_string(page).map_err(|e| Error::file(page, e))?;
    std::fs::write(page, replace(&text, name, content)?).map_err(|e| Error::file(page, e))
}

/// Tells people how far an evaluation is.
pub fn say(words: &str) {
    // Where nobody listens, the report has it all.
    let _ = writeln!(std::io::stdout(), "{words}");
}

fn head(page: &str) -> String {
    page.lines().next().unwrap_or_default().to_owned()
}

/// A Markdown table.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let header: Vec<String> = header.iter().map(|cell| (*cell).to_owned()).collect();
    let rule = vec!["---".to_owned(); header.len()];
    [line(&header), line(&rule)].into_iter().chain(rows.iter().map(|row| line(row))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_stands_between_the_markers_is_replaced() {
        let page = "# P\n<!-- begin: a -->\nold\n<!-- end: a -->\nafter <!-- begin: b --><!-- end: b -->\n";
        let table = table(&["x", "y"], &[vec!["1".to_owned(), "2".to_owned()]]);
        let new = replace(page, "a", &table).unwrap();
        assert_eq!(
            new,
            "# P\n<!-- begin: a -->\n\n| x | y |\n| --- | --- |\n| 1 | 2 |\n\n<!-- end: a -->\nafter <!-- begin: b --><!-- end: b -->\n"
        );
        assert_eq!(replace(&new, "a", &table).unwrap(), new);
        assert!(replace(page, "c", "").is_err());
    }
}
