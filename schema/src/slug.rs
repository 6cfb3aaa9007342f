//! Slugs: names of sites, levels and robots in paths, chosen by people.

/// Longest slug.
pub const SLUG_LENGTH_MAX: usize = 64;

/// Whether `text` is a slug: lower-case letters, digits and inner hyphens, 1 to 64 of them.
pub fn is_slug(text: &str) -> bool {
    !text.is_empty()
        && text.len() <= SLUG_LENGTH_MAX
        && text.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-')
        && !text.starts_with('-')
        && !text.ends_with('-')
}
