//! Readings of a flat target, from a table of text with commas.

/// Most readings of one calibration: 400 distances x 20 incidences x 1000.
const READINGS_MAX: usize = 8_000_000;
/// Farthest target, metres.
const DISTANCE_MAX_M: f64 = 1000.0;
/// Greatest incidence of a target, degrees: beyond, a beam hardly meets it.
const INCIDENCE_MAX_DEG: f64 = 85.0;
/// Surfaces that are told apart.
const SURFACES_MAX: usize = 64;

/// One reading of the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetReading {
    /// True distance along the beam, metres.
    pub distance: f64,
    /// Angle between the beam and the target's normal, radians.
    pub incidence: f64,
    /// What the scanner said, metres.
    pub reading: f64,
    /// Which surface, counted in the order in which they appear.
    pub surface: usize,
}

/// All readings of a calibration.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TargetReadings {
    /// Readings with a return.
    pub readings: Vec<TargetReading>,
    /// Names of the surfaces.
    pub surfaces: Vec<String>,
    /// Readings of 0: nothing came back.
    pub lost: usize,
}

/// A line that is no reading, and what would be one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct ReadingsError {
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong and what to do.
    pub fault: String,
}

/// Where the columns are.
struct Columns {
    distance: usize,
    incidence: usize,
    reading: usize,
    surface: Option<usize>,
    count: usize,
}

const HEADING: &str = "distance_m,incidence_deg,reading_m[,surface]";

impl TargetReadings {
    /// Reads a table: a heading with the columns `distance_m`, `incidence_deg`, `reading_m` and, if
    /// there are several, `surface`, in any order; a reading on each line after it. Empty lines and
    /// lines that begin with `#` are passed over.
    ///
    /// # Errors
    /// The first line that does not fit.
    pub fn parse(text: &str) -> Result<Self, ReadingsError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = (1..)
            .zip(text.lines().map(str::trim))
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let (line, heading) = lines.next().ok_or_else(|| ReadingsError {
            line: 1,
            fault: format!("the table is empty: begin it with the heading {HEADING}"),
        })?;
        let columns = Columns::of(heading).map_err(|fault| ReadingsError { line, fault })?;
        let mut all = Self::default();
        for (line, row) in lines {
            all.add(row, &columns).map_err(|fault| ReadingsError { line, fault })?;
        }
        Ok(all)
    }

    fn add(&mut self, row: &str, columns: &Columns) -> Result<(), String> {
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        if cells.len() != columns.count {
            return Err(format!(
                "{} cells where the heading has {}: separate them by commas, write decimals with a \
                 point",
                cells.len(),
                columns.count
            ));
        }
        let distance = number(cells[columns.distance], "distance_m")?;
        if !(distance > 0.0 && distance <= DISTANCE_MAX_M) {
            return Err(format!(
                "distance_m is {distance}: it must be more than 0 and at most {DISTANCE_MAX_M}; \
                 give metres from the scanner's centre along the beam"
            ));
        }
        let degrees = number(cells[columns.incidence], "incidence_deg")?.abs();
        if degrees > INCIDENCE_MAX_DEG {
            return Err(format!(
                "incidence_deg is {degrees}: it must be at most {INCIDENCE_MAX_DEG}; give degrees \
                 between the beam and the target's normal, 0 when the target faces the scanner"
            ));
        }
        let reading = number(cells[columns.reading], "reading_m")?;
        if !(0.0..=2.0 * DISTANCE_MAX_M).contains(&reading) {
            return Err(format!(
                "reading_m is {reading}: it must be a distance in metres, or 0 if nothing came back"
            ));
        }
        let name = columns.surface.map_or("", |at| cells[at]);
        let surface = match self.surfaces.iter().position(|known| known == name) {
            Some(known) => known,
            None if self.surfaces.len() == SURFACES_MAX => {
                return Err(format!("{name:?} would be more than {SURFACES_MAX} surfaces"));
            }
            None => {
                self.surfaces.push(name.to_owned());
                self.surfaces.len() - 1
            }
        };
        if self.readings.len() == READINGS_MAX {
            return Err(format!("more than {READINGS_MAX} readings: leave some out"));
        }
        if reading > 0.0 {
            let incidence = degrees.to_radians();
            self.readings.push(TargetReading { distance, incidence, reading, surface });
        } else {
            self.lost += 1;
        }
        Ok(())
    }
}

impl Columns {
    fn of(heading: &str) -> Result<Self, String> {
        let names: Vec<&str> = heading.split(',').map(str::trim).collect();
        let at = |name: &str| names.iter().position(|n| *n == name);
        let need = |name: &str| {
            at(name).ok_or_else(|| {
                format!("the heading lacks the column {name}: begin the table with {HEADING}")
            })
        };
        Ok(Self {
            distance: need("distance_m")?,
            incidence: need("incidence_deg")?,
            reading: need("reading_m")?,
            surface: at("surface"),
            count: names.len(),
        })
    }
}

fn number(cell: &str, column: &str) -> Result<f64, String> {
    match cell.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("{column} is {cell:?}: it must be a number")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_may_stand_in_any_order_and_lines_may_be_remarks() {
        let text = "\u{feff}# of a Tuesday\r\nreading_m, surface,distance_m,incidence_deg\r\n\r\n\
                    1.02,grey,1,-30\r\n0,grey,1,-30\n2.01,white,2.0,0\n";
        let all = TargetReadings::parse(text).unwrap();
        assert_eq!(all.surfaces, ["grey", "white"]);
        assert_eq!((all.readings.len(), all.lost), (2, 1));
        assert_eq!(
            all.readings[0],
            TargetReading {
                distance: 1.0,
                incidence: 30f64.to_radians(),
                reading: 1.02,
                surface: 0
            }
        );
    }

    #[test]
    fn every_fault_names_its_line_and_what_to_do() {
        let head = "distance_m,incidence_deg,reading_m\n1,0,1.0\n";
        for (row, line, words) in [
            ("", 1, "begin it with the heading"),
            ("distance,incidence_deg,reading_m\n", 1, "lacks the column distance_m"),
            ("1,0\n", 3, "2 cells where the heading has 3"),
            ("1,5,0,2\n", 3, "write decimals with a point"),
            ("1,0,near\n", 3, "reading_m is \"near\": it must be a number"),
            ("1,0,NaN\n", 3, "it must be a number"),
            ("0,0,1\n", 3, "more than 0"),
            ("1,90,1\n", 3, "0 when the target faces the scanner"),
            ("1,0,-1\n", 3, "or 0 if nothing came back"),
        ] {
            let text = if line == 1 { row.to_owned() } else { format!("{head}{row}") };
            let error = TargetReadings::parse(&text).unwrap_err();
            assert_eq!(error.line, line, "{row:?}");
            assert!(error.to_string().contains(words), "{row:?}: {error}");
        }
    }
}
