//! The text of a token.

use rand::{Rng, RngExt};
use sha2::{Digest, Sha256};

const PREFIX: &str = "mapd_";
const ID_LENGTH: usize = 12;
const SUFFIX_LENGTH: usize = 8;
/// 43 characters out of 62 hold 256 bits.
const SECRET_LENGTH: usize = 43;
const BASE62: &[u8; 62] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";

/// Shortest and longest token that people may choose themselves.
const CHOSEN_LENGTH: std::ops::RangeInclusive<usize> = 16..=256;

/// A token, with its secret. Deliberately neither `Debug` nor `Display` nor comparable: it is
/// shown once, by [`Token::reveal`], and compared by its digest in constant time.
#[derive(Clone)]
pub struct Token {
    id: String,
    text: String,
}

/// The id of the token that a session was made from; the id itself if it is no session's.
pub(super) fn parent_id(id: &str) -> &str {
    id.split_once('-').map_or(id, |(parent, _)| parent)
}

fn random_text(rng: &mut (impl Rng + ?Sized), length: usize) -> String {
    (0..length).map(|_| char::from(BASE62[rng.random_range(0..BASE62.len())])).collect()
}

impl Token {
    /// A new token.
    pub(super) fn generate(rng: &mut (impl Rng + ?Sized)) -> Self {
        let id = random_text(rng, ID_LENGTH);
        Self::with_id(rng, id)
    }

    /// A new token of a session that was made from the token `parent`.
    pub(super) fn generate_under(rng: &mut (impl Rng + ?Sized), parent: &str) -> Self {
        let id = format!("{parent}-{}", random_text(rng, SUFFIX_LENGTH));
        Self::with_id(rng, id)
    }

    fn with_id(rng: &mut (impl Rng + ?Sized), id: String) -> Self {
        let secret = random_text(rng, SECRET_LENGTH);
        Self { text: format!("{PREFIX}{id}_{secret}"), id }
    }

    /// A token from its text; `None` if it cannot be one. A text of another form is one that
    /// people chose: 16 to 256 visible ASCII characters.
    pub fn parse(text: &str) -> Option<Self> {
        if !CHOSEN_LENGTH.contains(&text.len()) || !text.bytes().all(|b| b.is_ascii_graphic()) {
            return None;
        }
        let id = match Self::id_of_generated(text) {
            Some(id) => id.to_owned(),
            None => Self::id_of_chosen(text),
        };
        Some(Self { id, text: text.to_owned() })
    }

    fn id_of_generated(text: &str) -> Option<&str> {
        let (id, secret) = text.strip_prefix(PREFIX)?.split_once('_')?;
        let base62 = |part: &str| part.bytes().all(|b| b.is_ascii_alphanumeric());
        let id_fits = match id.split_once('-') {
            Some((parent, suffix)) => {
                parent.len() == ID_LENGTH
                    && suffix.len() == SUFFIX_LENGTH
                    && base62(parent)
                    && base62(suffix)
            }
            None => id.len() == ID_LENGTH && base62(id),
        };
        (id_fits && secret.len() >= SECRET_LENGTH && base62(secret)).then_some(id)
    }

    fn id_of_chosen(text: &str) -> String {
        // Another hash than the stored one, so that the public id tells nothing of that.
        let digest =
            Sha256::new().chain_update(b"mapfold token id\0").chain_update(text).finalize();
        digest[..ID_LENGTH].iter().map(|b| char::from(BASE62[usize::from(*b) % 62])).collect()
    }

    /// Its public id.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// SHA-256 of the whole text.
    pub(super) fn digest(&self) -> [u8; 32] {
        Sha256::digest(&self.text).into()
    }

    /// The whole text: to show it once, to its holder.
    pub fn reveal(&self) -> &str {
        &self.text
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand::rngs::StdRng;

    use super::*;

    #[test]
    fn a_generated_token_reads_back_as_itself() {
        let mut rng = StdRng::seed_from_u64(1);
        for token in [Token::generate(&mut rng), Token::generate_under(&mut rng, "0123456789AB")] {
            let read = Token::parse(token.reveal()).unwrap();
            assert_eq!(read.id(), token.id());
            assert_eq!(read.digest(), token.digest());
            let secret = token.reveal().rsplit_once('_').unwrap().1;
            assert_eq!(secret.len(), SECRET_LENGTH);
        }
        let other = Token::generate(&mut rng);
        assert_ne!(other.id(), Token::generate(&mut rng).id());
    }

    #[test]
    fn a_session_names_its_parent() {
        let mut rng = StdRng::seed_from_u64(1);
        let parent = Token::generate(&mut rng);
        let session = Token::generate_under(&mut rng, parent.id());
        assert_eq!(parent_id(session.id()), parent.id());
        assert_eq!(parent_id(parent.id()), parent.id());
    }

    #[test]
    fn a_chosen_token_must_be_long_enough_and_has_a_stable_id() {
        assert!(Token::parse("short").is_none());
        assert!(Token::parse("with a space in the middle").is_none());
        assert!(Token::parse(&"x".repeat(257)).is_none());
        let chosen = Token::parse("a-token-that-people-chose").unwrap();
        assert_eq!(chosen.id(), Token::parse("a-token-that-people-chose").unwrap().id());
        assert_ne!(chosen.id(), Token::parse("a-token-that-people-chase").unwrap().id());
        assert_eq!(chosen.id().len(), ID_LENGTH);
    }

    #[test]
    fn a_damaged_token_does_not_pass_for_the_id_it_names() {
        let mut rng = StdRng::seed_from_u64(1);
        let token = Token::generate(&mut rng);
        let text = token.reveal();
        let shortened = Token::parse(&text[..text.len() - 1]).unwrap();
        assert_ne!(shortened.id(), token.id());
    }
}
