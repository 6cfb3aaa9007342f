//! The operators' page, inside the program: what `web/dist` held when it was compiled, or, where
//! the page was not built, a few words that say how to build it. Knows no HTTP.
//!
//! Debug builds read `web/dist` at run time, so that the page can be worked on without compiling.

use std::borrow::Cow;

use rust_embed::RustEmbed;

#[derive(RustEmbed)]
#[folder = "../web/dist"]
#[allow_missing = true]
struct Dist;

/// Where the files are whose names change with their content.
const HASHED: &str = "assets/";
const INDEX: &str = "index.html";

/// A file of the page.
#[derive(Debug)]
pub struct Asset {
    /// Its bytes.
    pub bytes: Cow<'static, [u8]>,
    /// SHA-256 of them.
    pub digest: [u8; 32],
    /// Its media type.
    pub media_type: &'static str,
    /// Whether its name changes with its content, so that it can be kept for ever.
    pub is_immutable: bool,
}

/// The first file of the page.
pub fn index() -> Asset {
    asset(INDEX).unwrap_or(Asset {
        bytes: Cow::Borrowed(include_bytes!("page/unbuilt.html")),
        digest: [0; 32],
        media_type: "text/html; charset=utf-8",
        is_immutable: false,
    })
}

/// A file of the page by its path; `None` if the page has none of that name.
pub fn asset(path: &str) -> Option<Asset> {
    let file = Dist::get(path)?;
    Some(Asset {
        digest: file.metadata.sha256_hash(),
        bytes: file.data,
        media_type: media_type(path),
        is_immutable: path.starts_with(HASHED),
    })
}

/// The media type of what a page is made of.
pub fn media_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "html" => "text/html; charset=utf-8",
        "js" | "mjs" => "text/javascript; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "json" | "map" => "application/json",
        "webmanifest" => "application/manifest+json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "ico" => "image/x-icon",
        "woff2" => "font/woff2",
        "wasm" => "application/wasm",
        "txt" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_always_a_first_page() {
        let index = index();
        assert!(index.media_type.starts_with("text/html"));
        assert!(!index.bytes.is_empty() && !index.is_immutable);
    }

    #[test]
    fn nothing_outside_the_page_can_be_had() {
        for path in ["../package.json", "/etc/passwd", "assets/../../package.json", "", "."] {
            assert!(asset(path).is_none(), "{path:?}");
        }
    }
}
