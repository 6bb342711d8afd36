//! Numbers that are marked, each once.

use crate::bytes;

/// Marks on numbers below a count, with the list of those that are marked, in the order of marking.
#[derive(Debug, Clone, Default)]
pub(crate) struct Marks {
    is: Vec<bool>,
    list: Vec<u32>,
}

impl Marks {
    /// Takes all marks away, for numbers below `count`.
    pub(crate) fn clear(&mut self, count: usize) {
        self.list.drain(..).for_each(|i| self.is[i as usize] = false);
        self.is.resize(count, false);
    }

    /// Marks a number.
    pub(crate) fn mark(&mut self, i: u32) {
        if !core::mem::replace(&mut self.is[i as usize], true) {
            self.list.push(i);
        }
    }

    /// Whether a number is marked.
    pub(crate) fn has(&self, i: usize) -> bool {
        self.is[i]
    }

    /// All that are marked.
    pub(crate) fn list(&self) -> &[u32] {
        &self.list
    }

    /// Brings the list into ascending order.
    pub(crate) fn sort(&mut self) {
        self.list.sort_unstable();
    }

    /// Bytes that they take.
    pub(crate) fn bytes(&self) -> usize {
        bytes::of(&self.is) + bytes::of(&self.list)
    }
}
