//! Evidence from readings: what one look says about which cells are free and which are occupied.
//!
//! Works in the level frame, on the level's grid. Knows nothing of maps: what is made of a look never
//! changes after, whatever others have seen, which is what lets it be added in any order and taken
//! out. Who knows walls beforehand may say so ([`KnownWalls`]), for sonars hear ghosts behind them.
//!
//! * [`scanner_evidence`]: narrow beams.
//! * [`sonar_evidence`]: wide cones.
//! * [`Canvas`]: where a look's evidence comes together before it becomes a patch.

mod canvas;
mod outline;
mod scanner;
mod sonar;
mod stroke;
mod walk;
mod window;

pub use canvas::Canvas;
pub use scanner::{ScannerEvidenceConfig, beam_evidence, scanner_evidence};
pub use sonar::{KnownWalls, SonarEvidenceConfig, SonarRule, SonarVerdicts, sonar_evidence};
