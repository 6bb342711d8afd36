//! The list of batches in the predicted deformation space (paper, section II.4), as both modes choose it.

use core::mem;

/// Batches of a part that are in the space, in their order, and those that were before the last choice.
#[derive(Debug, Clone, Default)]
pub(crate) struct Space {
    active: Vec<u32>,
    before: Vec<u32>,
}

impl Space {
    /// Chooses among `count` batches; `anew` forgets the last choice. `belongs` tells of a batch whether it is to be in the space,
    /// given whether it was: what has joined leaves later than it would join (hysteresis).
    pub(crate) fn choose(&mut self, anew: bool, count: usize, mut belongs: impl FnMut(usize, bool) -> bool) {
        mem::swap(&mut self.active, &mut self.before);
        self.active.clear();
        let mut inside = self.before.iter().filter(|_| !anew).peekable();
        for b in 0..count as u32 {
            let was = inside.next_if_eq(&&b).is_some();
            if belongs(b as usize, was) {
                self.active.push(b);
            }
        }
    }

    /// Batches in the space.
    pub(crate) fn batches(&self) -> &[u32] {
        &self.active
    }

    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> usize {
        crate::bytes::of(&self.active) + crate::bytes::of(&self.before)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_joined_stays_down_to_the_lower_bound_and_a_choice_anew_forgets_it() {
        let mut space = Space::default();
        let (join, leave) = (10, 5);
        let choose = |space: &mut Space, anew: bool, ways: [u32; 4]| {
            space.choose(anew, 4, |b, was| ways[b] > if was { leave } else { join });
            space.batches().to_vec()
        };
        assert_eq!(choose(&mut space, false, [11, 7, 0, 12]), [0, 3]);
        assert_eq!(choose(&mut space, false, [7, 7, 11, 5]), [0, 2]);
        assert_eq!(choose(&mut space, false, [7, 11, 6, 7]), [0, 1, 2]);
        assert_eq!(choose(&mut space, true, [7, 7, 11, 5]), [2]);
    }
}
