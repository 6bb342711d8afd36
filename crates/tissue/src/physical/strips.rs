//! The elements around a vertex as strips of triangles, so that each element needs one new vertex instead of three.
//!
//! The sides opposite the vertex make a surface of triangles, closed or with a border. A walk goes from triangle to
//! triangle over common edges and remembers the last edge `(a, b)`; the next vertex `c` completes the triangle
//! `(a, b, c)`, and the walk goes on over its edge `(a, c)` or `(c, b)`. Where it gets stuck, steps without an element
//! lead to another edge. Around nearly all vertices one walk passes all triangles.

/// An element around a vertex, and its other corners in positive order.
pub(super) type Spoke = (u32, [u32; 3]);

/// A step of a walk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Step {
    /// The next vertex.
    pub(super) vertex: u32,
    /// Element that it completes with the last edge; none for the first two vertices and for steps elsewhere.
    pub(super) element: Option<u32>,
    /// Whether the walk goes on over `(a, c)`, else over `(c, b)`.
    pub(super) keeps_first: bool,
}

/// The walk around a vertex. Empty without elements.
pub(super) fn walk(spokes: &[Spoke]) -> Vec<Step> {
    let neighbours = neighbours(spokes);
    let mut best: Vec<Vec<usize>> = Vec::new();
    for start in 0..spokes.len() {
        let paths = cover(&neighbours, start);
        if best.is_empty() || paths.len() < best.len() {
            best = paths;
        }
        if best.len() == 1 {
            break;
        }
    }
    let mut out = Vec::with_capacity(spokes.len() + 2);
    best.iter().for_each(|path| follow(path, spokes, &mut out));
    out
}

/// Triangles over the edges of each, by the edge's first corner.
fn neighbours(spokes: &[Spoke]) -> Vec<[Option<usize>; 3]> {
    let mut edges: Vec<(u32, u32, usize)> = Vec::with_capacity(3 * spokes.len());
    for (i, (_, t)) in spokes.iter().enumerate() {
        edges.extend((0..3).map(|k| (t[k], t[(k + 1) % 3], i)));
    }
    edges.sort_unstable();
    let over = |from: u32, to: u32| {
        let at = edges.partition_point(|e| (e.0, e.1) < (to, from));
        edges.get(at).filter(|e| (e.0, e.1) == (to, from)).map(|e| e.2)
    };
    spokes.iter().map(|(_, t)| [0, 1, 2].map(|k| over(t[k], t[(k + 1) % 3]))).collect()
}

/// Paths over common edges that pass each triangle once: always on to the triangle with the fewest ways out.
fn cover(neighbours: &[[Option<usize>; 3]], start: usize) -> Vec<Vec<usize>> {
    let mut passed = vec![false; neighbours.len()];
    let ways = |t: usize, passed: &[bool]| neighbours[t].iter().flatten().filter(|&&n| !passed[n]).count();
    let mut paths = Vec::new();
    let mut next = Some(start);
    while let Some(first) = next {
        passed[first] = true;
        let mut path = vec![first];
        for _ in 0..2 {
            // To one end, then from the other.
            path.reverse();
            while let Some(&last) = path.last() {
                let on = neighbours[last].iter().flatten().copied().filter(|&n| !passed[n]);
                let Some(n) = on.min_by_key(|&n| (ways(n, &passed), n)) else { break };
                passed[n] = true;
                path.push(n);
            }
        }
        paths.push(path);
        next = (0..neighbours.len()).filter(|&t| !passed[t]).min_by_key(|&t| (ways(t, &passed), t));
    }
    paths
}

/// Appends the steps through a path.
fn follow(path: &[usize], spokes: &[Spoke], out: &mut Vec<Step>) {
    let corners = |i: usize| spokes[path[i]].1;
    let turns = |t: [u32; 3]| [t, [t[1], t[2], t[0]], [t[2], t[0], t[1]]];
    // The second triangle lies over an edge with the vertex that completes the first.
    let second: Option<[u32; 3]> = (path.len() > 1).then(|| corners(1));
    let fits = |t: &[u32; 3]| second.is_none_or(|s| !(s.contains(&t[0]) && s.contains(&t[1])));
    let starts = turns(corners(0)).into_iter().filter(fits);
    let mut state = enter(starts, out);
    for (i, &triangle) in path.iter().enumerate() {
        let (element, t) = spokes[triangle];
        let c = t.into_iter().find(|v| *v != state.0 && *v != state.1).unwrap_or(t[2]);
        // Only what lies over an edge follows in a path.
        let keeps_first = i + 1 == path.len() || corners(i + 1).contains(&state.0);
        out.push(Step { vertex: c, element: Some(element), keeps_first });
        state = if keeps_first { (state.0, c) } else { (c, state.1) };
    }
}

/// Goes to the first edge of one of the triangles `starts` in as few steps as possible; returns that edge.
fn enter(starts: impl Iterator<Item = [u32; 3]>, out: &mut Vec<Step>) -> (u32, u32) {
    let plain = |vertex: u32, keeps_first: bool| Step { vertex, element: None, keeps_first };
    let mut best: Option<(Vec<Step>, bool, (u32, u32))> = None;
    for [x, y, _] in starts {
        for (keeps_first, (a, b)) in ends(out) {
            let way = if (a, b) == (x, y) {
                vec![]
            } else if a == x {
                vec![plain(y, true)]
            } else if b == y {
                vec![plain(x, false)]
            } else {
                vec![plain(x, false), plain(y, true)]
            };
            if best.as_ref().is_none_or(|b| way.len() < b.0.len()) {
                best = Some((way, keeps_first, (x, y)));
            }
        }
    }
    let (way, keeps_first, edge) = best.unwrap_or_default();
    if let Some(last) = out.last_mut() {
        last.keeps_first = keeps_first;
    }
    out.extend(way);
    edge
}

/// The edges that a walk can go on over, and whether it then keeps the first vertex.
fn ends(steps: &[Step]) -> Vec<(bool, (u32, u32))> {
    let Some((last, before)) = steps.split_last() else { return vec![(true, (u32::MAX, u32::MAX))] };
    let mut state = (before[0].vertex, before.get(1).unwrap_or(last).vertex);
    for s in before.iter().skip(2) {
        state = if s.keeps_first { (state.0, s.vertex) } else { (s.vertex, state.1) };
    }
    vec![(true, (state.0, last.vertex)), (false, (last.vertex, state.1))]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles that a walk passes, with their elements.
    fn passed(steps: &[Step]) -> Vec<(u32, [u32; 3])> {
        let mut out = Vec::new();
        let mut state = (steps[0].vertex, steps[1].vertex);
        assert!(steps[..2].iter().all(|s| s.element.is_none()));
        for s in &steps[2..] {
            if let Some(e) = s.element {
                let mut t = [state.0, state.1, s.vertex];
                // The same turn for each: the smallest corner first.
                let least = (0..3).min_by_key(|&k| t[k]).expect("three");
                t.rotate_left(least);
                out.push((e, t));
            }
            state = if s.keeps_first { (state.0, s.vertex) } else { (s.vertex, state.1) };
        }
        out.sort_unstable();
        out
    }

    fn expected(spokes: &[Spoke]) -> Vec<Spoke> {
        let mut out = spokes.to_vec();
        for (_, t) in &mut out {
            let least = (0..3).min_by_key(|&k| t[k]).expect("three");
            t.rotate_left(least);
        }
        out.sort_unstable();
        out
    }

    /// An octahedron, an icosahedron's cap and their like: a closed fan of `n` triangles above and one below.
    fn double_cone(n: u32) -> Vec<Spoke> {
        let ring = |i: u32| 2 + i % n;
        let top = (0..n).map(|i| (i, [0, ring(i), ring(i + 1)]));
        top.chain((0..n).map(|i| (n + i, [1, ring(i + 1), ring(i)]))).collect()
    }

    #[test]
    fn a_closed_surface_takes_two_steps_more_than_it_has_triangles() {
        for n in 3..12 {
            let spokes = double_cone(n);
            let steps = walk(&spokes);
            assert_eq!(passed(&steps), expected(&spokes));
            assert_eq!(steps.len(), spokes.len() + 2, "{n}");
        }
    }

    #[test]
    fn separate_triangles_and_borders_are_all_passed_in_their_orientation() {
        let spokes: Vec<Spoke> =
            vec![(7, [10, 11, 12]), (3, [20, 21, 22]), (4, [21, 20, 23]), (5, [12, 30, 31]), (6, [40, 22, 21])];
        assert_eq!(passed(&walk(&spokes)), expected(&spokes));
        let one: Vec<Spoke> = vec![(0, [1, 2, 3])];
        assert_eq!(passed(&walk(&one)), expected(&one));
        assert_eq!(walk(&one).len(), 3);
        assert!(walk(&[]).is_empty());
    }

    #[test]
    fn any_part_of_a_surface_is_passed() {
        let all = double_cone(9);
        for pattern in 1..512u32 {
            let part: Vec<Spoke> = all.iter().copied().filter(|s| pattern >> (s.0 * 5 % 9) & 1 == 1).collect();
            assert_eq!(passed(&walk(&part)), expected(&part), "{pattern}");
        }
    }
}
