//! From bytes to messages, line by line, with the digest of all that was read.

use std::io::{BufRead, BufReader, Read};

use flate2::bufread::MultiGzDecoder;
use sha2::{Digest, Sha256};

use super::line::{LineError, LineFault, Message, parse};

/// Longest line taken for one: a scan of 4096 beams is 40 kB.
const LINE_BYTES_MAX: u64 = 1 << 20;

/// A source that failed.
#[derive(Debug, thiserror::Error)]
#[error("cannot read on after line {after_line}: {source}")]
pub struct StreamError {
    /// Last line that was read.
    pub after_line: u64,
    /// Why.
    pub source: std::io::Error,
}

/// Opens a stream of messages; two magic bytes tell gzip from text.
///
/// # Errors
/// A source whose first bytes cannot be read.
pub fn messages(mut source: impl BufRead + 'static) -> Result<Messages, StreamError> {
    let head = source.fill_buf().map_err(|source| StreamError { after_line: 0, source })?;
    let text: Box<dyn BufRead> = if head.starts_with(&[0x1f, 0x8b]) {
        Box::new(BufReader::with_capacity(1 << 16, MultiGzDecoder::new(source)))
    } else {
        Box::new(source)
    };
    Ok(Messages { text, digest: Sha256::new(), line: 0, bytes: Vec::new(), failed: None })
}

/// The messages of a log, one a line; comments and empty lines are passed over.
pub struct Messages {
    text: Box<dyn BufRead>,
    digest: Sha256,
    line: u64,
    bytes: Vec<u8>,
    failed: Option<StreamError>,
}

impl std::fmt::Debug for Messages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Messages").field("line", &self.line).finish_non_exhaustive()
    }
}

impl Messages {
    /// Lines read so far.
    pub fn lines(&self) -> u64 {
        self.line
    }

    /// What cut the log short, if it was; and the digest of all its text.
    pub fn finish(self) -> (Option<StreamError>, [u8; 32]) {
        (self.failed, self.digest.finalize().into())
    }

    /// The next line into `self.bytes`, without its end; `false` at the end of the log.
    fn next_line(&mut self) -> std::io::Result<bool> {
        self.bytes.clear();
        let mut limited = (&mut self.text).take(LINE_BYTES_MAX);
        if limited.read_until(b'\n', &mut self.bytes)? == 0 {
            return Ok(false);
        }
        self.digest.update(&self.bytes);
        self.line += 1;
        Ok(true)
    }

    /// Passes over the rest of a line that was too long.
    fn skip_rest(&mut self) -> std::io::Result<()> {
        let mut rest = Vec::new();
        loop {
            rest.clear();
            let read = (&mut self.text).take(LINE_BYTES_MAX).read_until(b'\n', &mut rest)?;
            self.digest.update(&rest);
            if read == 0 || rest.ends_with(b"\n") {
                return Ok(());
            }
        }
    }
}

impl Iterator for Messages {
    type Item = Result<Message, LineError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.next_line() {
                Ok(true) => {}
                Ok(false) => return None,
                Err(source) => {
                    self.failed = Some(StreamError { after_line: self.line, source });
                    return None;
                }
            }
            if self.bytes.len() as u64 == LINE_BYTES_MAX && !self.bytes.ends_with(b"\n") {
                if let Err(source) = self.skip_rest() {
                    self.failed = Some(StreamError { after_line: self.line, source });
                }
                return Some(Err(LineError { line: self.line, fault: LineFault::TooLong }));
            }
            let parsed = match std::str::from_utf8(&self.bytes) {
                Ok(text) => parse(text),
                Err(_not_text) => Err(LineFault::NotText),
            };
            match parsed {
                Ok(None) => {}
                Ok(Some(message)) => return Some(Ok(message)),
                Err(fault) => return Some(Err(LineError { line: self.line, fault })),
            }
        }
    }
}
