//! One-time codes by which another device gets a token of its own without anybody typing thirty-two digits.

use crate::door::{Role, equal};
use std::net::IpAddr;
use std::time::{Duration, Instant};

/// How long a code can be used.
pub(crate) const LIFE: Duration = Duration::from_secs(600);
/// Codes that can wait at a time; the oldest goes first.
const MOST_CODES: usize = 16;
/// Wrong codes of one address within [`WINDOW`], after which all of its codes are refused until it has passed: nobody keeps
/// the others out.
const MOST_FAILURES: usize = 10;
/// The same of all addresses together: forty bits cannot be guessed that way.
const MOST_FAILURES_OF_ALL: usize = 300;
const WINDOW: Duration = Duration::from_secs(60);
/// Letters and digits that cannot be taken for one another (Crockford's base 32).
const ALPHABET: &[u8; 32] = b"0123456789ABCDEFGHJKMNPQRSTVWXYZ";

/// Why a code was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refused {
    /// Unknown, used, or too old.
    Wrong,
    /// Too many wrong ones of late.
    Wait,
}

/// The codes that can be used now.
#[derive(Debug, Default)]
pub(crate) struct Pairing {
    codes: Vec<(String, Role, Instant)>,
    failures: Vec<(IpAddr, Instant)>,
}

/// Eight characters in two groups.
fn spell(bytes: [u8; 8]) -> String {
    let letters = bytes.map(|b| char::from(ALPHABET[usize::from(b & 31)]));
    letters[..4].iter().chain(&['-']).chain(&letters[4..]).collect()
}

/// As people type it: any case, with or without the hyphen, with the letters that look like digits.
fn read(typed: &str) -> String {
    let one = |c: char| match c.to_ascii_uppercase() {
        'O' => '0',
        'I' | 'L' => '1',
        c => c,
    };
    typed.chars().filter(|c| c.is_ascii_alphanumeric()).map(one).collect()
}

impl Pairing {
    /// A new code for a role.
    ///
    /// # Errors
    /// When the system has no random numbers.
    pub(crate) fn offer(&mut self, role: Role, now: Instant) -> Result<String, getrandom::Error> {
        let mut bytes = [0; 8];
        getrandom::fill(&mut bytes)?;
        let code = spell(bytes);
        self.codes.retain(|(_, _, made)| now.duration_since(*made) < LIFE);
        if self.codes.len() >= MOST_CODES {
            self.codes.remove(0);
        }
        self.codes.push((read(&code), role, now));
        Ok(code)
    }

    /// Takes a code that somebody at `address` has typed; it is good once.
    ///
    /// # Errors
    /// When it is not good, or too many were not.
    pub(crate) fn redeem(&mut self, typed: &str, address: IpAddr, now: Instant) -> Result<Role, Refused> {
        self.failures.retain(|(_, at)| now.duration_since(*at) < WINDOW);
        let own = self.failures.iter().filter(|(from, _)| *from == address).count();
        if own >= MOST_FAILURES || self.failures.len() >= MOST_FAILURES_OF_ALL {
            return Err(Refused::Wait);
        }
        self.codes.retain(|(_, _, made)| now.duration_since(*made) < LIFE);
        let typed = read(typed);
        match self.codes.iter().position(|(code, ..)| equal(code, &typed)) {
            Some(at) => Ok(self.codes.remove(at).1),
            None => {
                self.failures.push((address, now));
                Err(Refused::Wrong)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    const HERE: IpAddr = IpAddr::V4(Ipv4Addr::new(10, 0, 0, 1));
    const THERE: IpAddr = IpAddr::V4(Ipv4Addr::new(10, 0, 0, 2));

    #[test]
    fn a_code_is_good_once_however_it_is_typed_and_not_for_long() {
        let (mut p, now) = (Pairing::default(), Instant::now());
        let code = p.offer(Role::Viewer, now).expect("random");
        let typed = code.to_lowercase().replace('-', " ").replace('0', "o").replace('1', "l");
        assert_eq!(p.redeem(&typed, HERE, now), Ok(Role::Viewer));
        assert_eq!(p.redeem(&code, HERE, now), Err(Refused::Wrong));
        let late = p.offer(Role::Operator, now).expect("random");
        assert_eq!(p.redeem(&late, HERE, now + LIFE), Err(Refused::Wrong));
        assert_eq!(p.redeem("", HERE, now), Err(Refused::Wrong));
    }

    #[test]
    fn guessing_is_stopped_for_who_guesses_and_the_right_code_works_a_minute_later() {
        let (mut p, now) = (Pairing::default(), Instant::now());
        let codes = [0; 2].map(|_| p.offer(Role::Operator, now).expect("random"));
        (0..MOST_FAILURES).for_each(|_| assert_eq!(p.redeem("ZZZZ-ZZZZ", HERE, now), Err(Refused::Wrong)));
        assert_eq!(p.redeem(&codes[0], HERE, now), Err(Refused::Wait));
        assert_eq!(p.redeem(&codes[1], THERE, now), Ok(Role::Operator));
        assert_eq!(p.redeem(&codes[0], HERE, now + WINDOW), Ok(Role::Operator));
    }

    #[test]
    fn many_addresses_guess_no_faster() {
        let (mut p, now) = (Pairing::default(), Instant::now());
        let code = p.offer(Role::Viewer, now).expect("random");
        let tries = (0..2 * MOST_FAILURES_OF_ALL as u32).map(|n| p.redeem("ZZZZ-ZZZZ", Ipv4Addr::from(n).into(), now));
        assert_eq!(tries.filter(|t| *t == Err(Refused::Wrong)).count(), MOST_FAILURES_OF_ALL);
        assert_eq!(p.redeem(&code, HERE, now), Err(Refused::Wait));
    }
}
