//! What stands in a map's YAML.

use std::borrow::Cow;
use std::fmt;

use super::Mode;
use super::mapping::{self, Entry, Text, Value};
use super::refusal::{ImportError, Warning};

/// Longest description that is read, in bytes.
pub const DESCRIPTION_BYTES_MAX: usize = 64 << 10;

/// Where an image lies and what its greys mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// Name of the image's file, as written.
    pub image: String,
    /// Edge of a pixel, metres; finite and positive.
    pub resolution_m: f64,
    /// Lower left corner of the lower left pixel in the map's frame: x and y in metres, and by
    /// how much the image is turned about it, radians, counter-clockwise. Finite.
    pub origin: [f64; 3],
    /// Whether white is occupied.
    pub negate: bool,
    /// From this occupancy (0 to 1) on a cell is occupied. Above `free_thresh`.
    pub occupied_thresh: f64,
    /// Up to this occupancy (0 to 1) a cell is free.
    pub free_thresh: f64,
    /// How greys stand for occupancy.
    pub mode: Mode,
}

impl Description {
    /// Reads a description; keys that mean nothing are warned of.
    ///
    /// # Errors
    /// What is missing or cannot be what it stands for, and where.
    pub fn read(yaml: &[u8]) -> Result<(Self, Vec<Warning>), ImportError> {
        if yaml.len() > DESCRIPTION_BYTES_MAX {
            let max = DESCRIPTION_BYTES_MAX;
            return Err(ImportError::DescriptionTooLong { bytes: yaml.len(), max });
        }
        let text = std::str::from_utf8(yaml).map_err(|error| {
            let before = &yaml[..error.valid_up_to()];
            let line = before.split(|byte| *byte == b'\n').count();
            let column = 1 + before.iter().rev().take_while(|byte| **byte != b'\n').count();
            ImportError::Yaml { line, column, fault: "the description is UTF-8 text".to_owned() }
        })?;
        let mut keys = Keys::default();
        let mut warnings = Vec::new();
        for Entry { key, value } in mapping::read(text)? {
            match key.word.as_ref() {
                "image" => keys.image = Some(image(&value)?),
                "resolution" => keys.resolution = Some(resolution(&value)?),
                "origin" => keys.origin = Some(origin(&value)?),
                "negate" => keys.negate = Some(truth(&value)?),
                "occupied_thresh" => {
                    keys.occupied = Some((share("occupied_thresh", &value)?, value));
                }
                "free_thresh" => keys.free = Some(share("free_thresh", &value)?),
                "mode" => keys.mode = Some(mode(&value)?),
                other => warnings.push(Warning::ExtraKey(other.to_owned())),
            }
        }
        Ok((keys.complete()?, warnings))
    }
}

/// What was found so far.
#[derive(Default)]
struct Keys<'a> {
    image: Option<String>,
    resolution: Option<f64>,
    origin: Option<[f64; 3]>,
    negate: Option<bool>,
    occupied: Option<(f64, Value<'a>)>,
    free: Option<f64>,
    mode: Option<Mode>,
}

impl Keys<'_> {
    fn complete(self) -> Result<Description, ImportError> {
        let missing = |key, advice| move || ImportError::MissingKey { key, advice };
        let image = self.image.ok_or_else(missing("image", "`image: map.pgm`"))?;
        let resolution_m = self
            .resolution
            .ok_or_else(missing("resolution", "`resolution: 0.05`, in metres a pixel"))?;
        let origin = self.origin.ok_or_else(missing(
            "origin",
            "`origin: [x, y, yaw]`, where the lower left corner of the image lies",
        ))?;
        let negate =
            self.negate.ok_or_else(missing("negate", "`negate: 0`, if black is occupied"))?;
        let (occupied_thresh, value) =
            self.occupied.ok_or_else(missing("occupied_thresh", "`occupied_thresh: 0.65`"))?;
        let free_thresh = self.free.ok_or_else(missing("free_thresh", "`free_thresh: 0.196`"))?;
        if occupied_thresh <= free_thresh {
            return Err(value.fault(format!(
                "`occupied_thresh` ({occupied_thresh}) is above `free_thresh` ({free_thresh})"
            )));
        }
        let mode = self.mode.unwrap_or_default();
        Ok(Description { image, resolution_m, origin, negate, occupied_thresh, free_thresh, mode })
    }
}

impl fmt::Display for Description {
    /// As YAML, each number in full: it is read back as it was.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, yaw] = self.origin;
        write!(
            f,
            "image: {}\nmode: {}\nresolution: {}\norigin: [{x:?}, {y:?}, {yaw:?}]\nnegate: {}\n\
             occupied_thresh: {}\nfree_thresh: {}\n",
            scalar(&self.image),
            self.mode.word(),
            self.resolution_m,
            u8::from(self.negate),
            self.occupied_thresh,
            self.free_thresh
        )
    }
}

/// A string as YAML: plain where nothing in it means more than itself, else between quotes (as in
/// JSON, which YAML contains).
fn scalar(text: &str) -> Cow<'_, str> {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    let is_word = ["true", "false", "yes", "no", "on", "off", "null", "y", "n"]
        .iter()
        .any(|word| text.eq_ignore_ascii_case(word));
    if text.starts_with(|c: char| c.is_ascii_alphabetic()) && text.chars().all(plain) && !is_word {
        Cow::Borrowed(text)
    } else {
        Cow::Owned(serde_json::Value::from(text).to_string())
    }
}

fn scalar_of<'v, 'a>(value: &'v Value<'a>, wanted: &str) -> Result<&'v Text<'a>, ImportError> {
    match value {
        Value::Scalar(text) => Ok(text),
        Value::List { .. } => Err(value.fault(format!("{wanted}, not a list"))),
    }
}

fn image(value: &Value) -> Result<String, ImportError> {
    let text = scalar_of(value, "`image` is the name of a file")?;
    if text.word.is_empty() {
        return Err(text.fault("`image` is the name of a file, such as `map.pgm`"));
    }
    Ok(text.word.clone().into_owned())
}

fn number(text: &Text, wanted: &str) -> Result<f64, ImportError> {
    let parsed = text.word.trim_start_matches('+').parse::<f64>().ok();
    parsed
        .filter(|number| text.plain && number.is_finite())
        .ok_or_else(|| text.fault(format!("{wanted}, not `{}`", text.word)))
}

fn resolution(value: &Value) -> Result<f64, ImportError> {
    let wanted = "`resolution` is metres a pixel, a number above 0";
    let text = scalar_of(value, wanted)?;
    let number = number(text, wanted)?;
    if number > 0.0 { Ok(number) } else { Err(text.fault(format!("{wanted}, not {number}"))) }
}

fn share(key: &str, value: &Value) -> Result<f64, ImportError> {
    let wanted = format!("`{key}` is a number from 0 to 1");
    let text = scalar_of(value, &wanted)?;
    let number = number(text, &wanted)?;
    if (0.0..=1.0).contains(&number) {
        Ok(number)
    } else {
        Err(text.fault(format!("{wanted}, not {number}")))
    }
}

fn origin(value: &Value) -> Result<[f64; 3], ImportError> {
    let wanted = "`origin` is three numbers, [x, y, yaw], in metres and radians";
    let Value::List { items, .. } = value else { return Err(value.fault(wanted)) };
    let [x, y, yaw] = items.as_slice() else {
        return Err(value.fault(format!("{wanted}, not {}", items.len())));
    };
    Ok([number(x, wanted)?, number(y, wanted)?, number(yaw, wanted)?])
}

/// A whole number, any but 0 for true, or a truth value as YAML 1.1 has them.
fn truth(value: &Value) -> Result<bool, ImportError> {
    let wanted = "`negate` is 0 or 1: whether white is occupied";
    let text = scalar_of(value, wanted)?;
    if let Ok(number) = text.word.parse::<i64>() {
        return Ok(number != 0);
    }
    match text.word.to_ascii_lowercase().as_str() {
        "true" | "yes" | "on" | "y" => Ok(true),
        "false" | "no" | "off" | "n" => Ok(false),
        _ => Err(text.fault(format!("{wanted}, not `{}`", text.word))),
    }
}

fn mode(value: &Value) -> Result<Mode, ImportError> {
    let wanted = "`mode` is trinary, scale or raw";
    let text = scalar_of(value, wanted)?;
    let found = Mode::ALL.into_iter().find(|mode| mode.word() == text.word);
    found.ok_or_else(|| text.fault(format!("{wanted}, not `{}`", text.word)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "image: map.pgm\nmode: scale\nresolution: 0.0333\n\
        origin: [-1.5, 2.25, 0.5]\nnegate: 1\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";

    fn read(yaml: &str) -> Result<(Description, Vec<Warning>), ImportError> {
        Description::read(yaml.as_bytes())
    }

    #[test]
    fn every_key_is_read_and_mode_may_be_left_out() {
        let (description, warnings) = read(GOOD).unwrap();
        let expected = Description {
            image: "map.pgm".into(),
            resolution_m: 0.0333,
            origin: [-1.5, 2.25, 0.5],
            negate: true,
            occupied_thresh: 0.65,
            free_thresh: 0.196,
            mode: Mode::Scale,
        };
        assert_eq!((description, warnings), (expected.clone(), vec![]));
        let (plain, _) = read(&GOOD.replace("mode: scale\n", "")).unwrap();
        assert_eq!(plain, Description { mode: Mode::Trinary, ..expected.clone() });
        // In any order, with comments, in the other notations of YAML, as other programs write it.
        let other = "# by hand\n---\nfree_thresh: .196\noccupied_thresh: 6.5e-1\nnegate: yes # white\n\
            origin:\n- -1.5\n- 2.25\n- +0.5\nresolution: 3.33e-2\nimage: \"map.pgm\"\nmode: 'scale'\n...\n";
        assert_eq!(read(other).unwrap().0, expected);
    }

    #[test]
    fn negate_is_a_number_or_a_truth_value() {
        for (word, negate) in [
            ("0", false),
            ("1", true),
            ("2", true),
            ("-1", true),
            ("true", true),
            ("False", false),
            ("yes", true),
            ("NO", false),
            ("on", true),
            ("off", false),
        ] {
            let (description, _) =
                read(&GOOD.replace("negate: 1", &format!("negate: {word}"))).unwrap();
            assert_eq!(description.negate, negate, "{word}");
        }
    }

    #[test]
    fn a_key_that_means_nothing_is_warned_of() {
        let (_, warnings) = read(&format!("{GOOD}colour: blue\n")).unwrap();
        assert_eq!(warnings, [Warning::ExtraKey("colour".into())]);
    }

    #[test]
    fn a_missing_key_is_named_with_what_to_write() {
        for key in ["image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"] {
            let others: Vec<&str> = GOOD.lines().filter(|line| !line.starts_with(key)).collect();
            let without = others.join("\n");
            let error = read(&without).unwrap_err();
            assert!(matches!(&error, ImportError::MissingKey { key: k, .. } if *k == key));
            let told = error.to_string();
            assert!(told.contains(&format!("`{key}: ")), "{told}");
        }
    }

    #[test]
    fn every_fault_names_its_place_and_what_should_stand_there() {
        for (from, to, line, column, words) in [
            ("image: map.pgm", "image: \"\"", 1, 8, "name of a file"),
            ("image: map.pgm", "image: [a, b]", 1, 8, "name of a file"),
            ("scale", "fancy", 2, 7, "trinary, scale or raw"),
            ("0.0333", "0", 3, 13, "above 0"),
            ("0.0333", "-0.05", 3, 13, "above 0"),
            ("0.0333", "five", 3, 13, "not `five`"),
            ("0.0333", "\"0.05\"", 3, 13, "a number"),
            ("0.0333", ".nan", 3, 13, "a number"),
            ("0.0333", "1e999", 3, 13, "a number"),
            ("[-1.5, 2.25, 0.5]", "[-1.5, 2.25]", 4, 9, "three numbers"),
            ("[-1.5, 2.25, 0.5]", "[-1.5, 2.25, 0.5, 0]", 4, 9, "not 4"),
            ("[-1.5, 2.25, 0.5]", "[-1.5, nan, 0.5]", 4, 16, "three numbers"),
            ("[-1.5, 2.25, 0.5]", "[-1.5, [1], 0.5]", 4, 16, "numbers only"),
            ("[-1.5, 2.25, 0.5]", "-1.5", 4, 9, "three numbers"),
            ("[-1.5, 2.25, 0.5]", "{x: 1}", 4, 9, "a list of numbers"),
            ("negate: 1", "negate: maybe", 5, 9, "0 or 1"),
            ("0.65", "1.65", 6, 18, "from 0 to 1"),
            ("0.65", "0.1", 6, 18, "is above `free_thresh`"),
            ("0.196", "-0.1", 7, 14, "from 0 to 1"),
            ("negate: 1", "negate: *one", 5, 9, ""),
            ("negate: 1", "image: other.pgm", 5, 1, "twice"),
            ("negate: 1", "? [a]\n: 1", 5, 3, "a key is a word"),
            ("negate: 1", "negate: \"1", 5, 9, ""),
            ("free_thresh: 0.196\n", "free_thresh: 0.196\n---\na: b\n", 8, 1, "one document"),
        ] {
            let yaml = GOOD.replace(from, to);
            match read(&yaml).unwrap_err() {
                ImportError::Yaml { line: l, column: c, fault } => {
                    assert_eq!(l, line, "{to}: {fault}");
                    assert!(c == column || words.is_empty(), "{to}: column {c}: {fault}");
                    assert!(fault.contains(words), "{to}: {fault}");
                }
                other => panic!("{to}: {other}"),
            }
        }
        for not_a_mapping in ["", "# nothing\n", "just words", "- a\n- b\n", "12"] {
            assert!(
                matches!(read(not_a_mapping), Err(ImportError::Yaml { .. })),
                "{not_a_mapping}"
            );
        }
    }

    #[test]
    fn what_is_no_text_or_swells_is_refused() {
        let error = Description::read(b"image: map.pgm\nmode: \xff\n").unwrap_err();
        assert!(matches!(error, ImportError::Yaml { line: 2, column: 7, .. }));
        let long = vec![b' '; DESCRIPTION_BYTES_MAX + 1];
        assert!(matches!(Description::read(&long), Err(ImportError::DescriptionTooLong { .. })));
        let laughs = "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n";
        assert!(matches!(read(laughs), Err(ImportError::Yaml { line: 2, .. })));
        let deep = format!("a: {}", "[".repeat(20_000));
        assert!(read(&deep).is_err());
    }

    #[test]
    fn a_name_that_means_something_in_yaml_stands_between_quotes() {
        for (name, written) in [
            ("floor-2.pgm", "floor-2.pgm"),
            ("2.pgm", "\"2.pgm\""),
            ("yes", "\"yes\""),
            ("a: #1 \"x\".pgm", "\"a: #1 \\\"x\\\".pgm\""),
        ] {
            assert_eq!(scalar(name), written);
            let description = Description { image: name.into(), ..read(GOOD).unwrap().0 };
            assert_eq!(read(&description.to_string()).unwrap().0, description);
        }
    }
}
