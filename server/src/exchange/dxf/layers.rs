//! Which layer of a drawing is what.

use mapfold_schema::v1::ObjectKind;

/// Patterns of layers' names and what is on them; the first that fits counts. Names after AIA and NCS, and plain words.
const STANDARD: [(&str, Option<ObjectKind>); 24] = [
    ("*-DEMO*", None),
    ("*-PATT*", None),
    ("*-TEXT*", None),
    ("A-WALL*", Some(ObjectKind::Wall)),
    ("WALL*", Some(ObjectKind::Wall)),
    ("A-GLAZ*", Some(ObjectKind::Wall)),
    ("A-COLS*", Some(ObjectKind::Wall)),
    ("S-COLS*", Some(ObjectKind::Wall)),
    ("COLUMN*", Some(ObjectKind::Wall)),
    ("A-DOOR*", Some(ObjectKind::Doorway)),
    ("A-OPENING*", Some(ObjectKind::Doorway)),
    ("DOOR*", Some(ObjectKind::Doorway)),
    ("A-AREA*", Some(ObjectKind::Corridor)),
    ("A-EQPM*", Some(ObjectKind::Machine)),
    ("M-EQPM*", Some(ObjectKind::Machine)),
    ("Q-*", Some(ObjectKind::Machine)),
    ("MACHINE*", Some(ObjectKind::Machine)),
    ("A-FURN*", Some(ObjectKind::Furniture)),
    ("I-FURN*", Some(ObjectKind::Furniture)),
    ("FURN*", Some(ObjectKind::Furniture)),
    ("A-CASE*", Some(ObjectKind::Furniture)),
    ("A-FIXT*", Some(ObjectKind::Furniture)),
    ("P-FIXT*", Some(ObjectKind::Furniture)),
    ("A-OTHR*", Some(ObjectKind::Other)),
];

/// What a table says of a layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Content {
    /// Things of this kind.
    Kind(ObjectKind),
    /// Nothing that is taken.
    Skipped,
    /// No pattern fits.
    Unknown,
}

impl Content {
    pub(super) fn kind(self) -> Option<ObjectKind> {
        match self {
            Self::Kind(kind) => Some(kind),
            Self::Skipped | Self::Unknown => None,
        }
    }

    /// Why nothing is taken.
    pub(super) fn why_not(self) -> &'static str {
        match self {
            Self::Skipped => "the layer is one of those that are skipped",
            _ => "the layer is not in the table: name it in `layers`",
        }
    }
}

/// Patterns that a request may add.
const ADDED_MAX: usize = 256;

/// What is on which layer.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LayerTable {
    /// Patterns that go before the standard ones; `None`: not taken.
    added: Vec<(String, Option<ObjectKind>)>,
}

impl LayerTable {
    /// The standard table after what `text` says: `PATTERN=KIND,...`, where a kind is that of an object or `skip`, and a
    /// star in a pattern stands for any letters.
    ///
    /// # Errors
    /// The part that says nothing.
    pub fn parse(text: &str) -> Result<Self, String> {
        let parts = text.split(',').map(str::trim).filter(|part| !part.is_empty());
        let mut added = Vec::new();
        for part in parts {
            let (pattern, word) = part.rsplit_once('=').ok_or_else(|| part.to_owned())?;
            let kind = match word.trim().to_ascii_lowercase().as_str() {
                "wall" => Some(ObjectKind::Wall),
                "doorway" => Some(ObjectKind::Doorway),
                "corridor" => Some(ObjectKind::Corridor),
                "machine" => Some(ObjectKind::Machine),
                "furniture" => Some(ObjectKind::Furniture),
                "other" => Some(ObjectKind::Other),
                "skip" => None,
                _ => return Err(part.to_owned()),
            };
            added.push((pattern.trim().to_ascii_uppercase(), kind));
        }
        if added.len() > ADDED_MAX {
            return Err(format!("more than {ADDED_MAX} patterns"));
        }
        Ok(Self { added })
    }

    /// What is on a layer. The layer of a drawing within a drawing
    /// (`plan$0$A-WALL`, `plan|A-WALL`) is known by its own name, too.
    pub(super) fn content_of(&self, layer: &str) -> Content {
        let full = layer.to_ascii_uppercase();
        let own = full.rsplit(['$', '|']).next().unwrap_or_default();
        let added = self.added.iter().map(|(pattern, kind)| (pattern.as_str(), *kind));
        let fits = |pattern: &str| fits(pattern, &full) || fits(pattern, own);
        match added.chain(STANDARD).find(|(pattern, _)| fits(pattern)) {
            Some((_, Some(kind))) => Content::Kind(kind),
            Some((_, None)) => Content::Skipped,
            None => Content::Unknown,
        }
    }
}

/// The layer that objects of a kind are written on: one that the standard table knows.
pub(super) fn layer_of(kind: ObjectKind) -> &'static str {
    match kind {
        ObjectKind::Wall => "A-WALL",
        ObjectKind::Doorway => "A-DOOR",
        ObjectKind::Corridor => "A-AREA",
        ObjectKind::Machine => "A-EQPM",
        ObjectKind::Furniture => "A-FURN",
        ObjectKind::Other => "A-OTHR",
    }
}

/// Whether a name fits a pattern, in one pass with the last star to come back to.
fn fits(pattern: &str, name: &str) -> bool {
    let (pattern, name) = (pattern.as_bytes(), name.as_bytes());
    let (mut p, mut n, mut star) = (0, 0, None);
    while n < name.len() {
        if pattern.get(p) == Some(&b'*') {
            star = Some((p, n));
            p += 1;
        } else if pattern.get(p) == Some(&name[n]) {
            (p, n) = (p + 1, n + 1);
        } else if let Some((at, from)) = star {
            star = Some((at, from + 1));
            (p, n) = (at + 1, from + 1);
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|byte| *byte == b'*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_known_by_their_own_names_and_a_request_goes_first() {
        let table = LayerTable::default();
        for (layer, kind) in [
            ("A-WALL", Some(ObjectKind::Wall)),
            ("a-wall-full", Some(ObjectKind::Wall)),
            ("xref-House-08$0$A-OPENING", Some(ObjectKind::Doorway)),
            ("plan|A-CASE-1", Some(ObjectKind::Furniture)),
            ("S-STEM-WALL", None),
            ("A-WALL-PATT", None),
            ("0", None),
        ] {
            assert_eq!(table.content_of(layer).kind(), kind, "{layer}");
        }
        for kind in [ObjectKind::Wall, ObjectKind::Corridor, ObjectKind::Machine, ObjectKind::Other]
        {
            assert_eq!(table.content_of(layer_of(kind)), Content::Kind(kind));
        }
        let table = LayerTable::parse("S-*=wall, a-case*=skip,*LIFT*=machine").unwrap();
        assert_eq!(table.content_of("S-STEM-WALL"), Content::Kind(ObjectKind::Wall));
        assert_eq!(table.content_of("A-CASE-1"), Content::Skipped);
        assert_eq!(table.content_of("GOODS LIFT 2"), Content::Kind(ObjectKind::Machine));
        assert_eq!(LayerTable::parse("S-*=tree"), Err("S-*=tree".to_owned()));
        assert_eq!(LayerTable::parse("S"), Err("S".to_owned()));
    }
}
