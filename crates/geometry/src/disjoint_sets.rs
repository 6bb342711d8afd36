//! Which things belong together.

/// Disjoint sets of the numbers below a count, with path halving; the root of a set is its smallest member.
#[derive(Debug, Clone)]
pub struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// `n` sets of one member each.
    pub fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    /// One more set of one member: its number.
    pub fn add(&mut self) -> u32 {
        let new = self.0.len() as u32;
        self.0.push(new);
        new
    }

    /// How many members all sets have together.
    #[expect(clippy::len_without_is_empty, reason = "sets of nothing are of no use")]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The smallest member of the set that holds `i`.
    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    /// Makes one set of those that hold `a` and `b`.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_joined_through_any_of_their_members() {
        let mut sets = DisjointSets::new(5);
        assert_eq!(sets.add(), 5);
        for (a, b) in [(4, 2), (5, 3), (4, 5)] {
            sets.join(a, b);
        }
        assert_eq!([0, 1, 2, 3, 4, 5].map(|i| sets.root(i)), [0, 1, 2, 2, 2, 2]);
    }
}
