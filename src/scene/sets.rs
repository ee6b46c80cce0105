//! Sets of things that are found to belong together (union-find).

/// A forest over things by their index: each points at an earlier one of its set, roots at themselves.
pub(crate) struct Sets {
    parent: Vec<usize>,
    count: usize,
}

impl Sets {
    /// Each of `n` things in a set of its own.
    pub(crate) fn new(n: usize) -> Self {
        Self { parent: (0..n).collect(), count: n }
    }

    /// How many sets there are.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// The first thing of a set, by one of the set.
    pub(crate) fn root(&mut self, mut i: usize) -> usize {
        while self.parent[i] != i {
            self.parent[i] = self.parent[self.parent[i]];
            i = self.parent[i];
        }
        i
    }

    /// Joins the sets of two things; false where they are one already.
    pub(crate) fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
        self.count -= usize::from(a != b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, parts of a mesh, or of a tour, would be taken for one, or one for several.
    #[test]
    fn what_is_joined_is_one_set_and_nothing_else() {
        let mut sets = Sets::new(6);
        assert!(sets.join(4, 2) && sets.join(5, 3) && sets.join(2, 5));
        assert!(!sets.join(3, 4), "these are one already");
        assert_eq!((0..6).map(|i| sets.root(i)).collect::<Vec<_>>(), [0, 1, 2, 2, 2, 2]);
        assert_eq!(sets.count(), 3);
    }
}
