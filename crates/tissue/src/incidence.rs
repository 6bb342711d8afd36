//! Which elements lie around what they are made of.

/// Where the elements around each of `count` vertices (or patches) begin, and these elements in order.
pub(crate) fn incident(corners: &[[u32; 4]], count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; count + 1];
    corners.iter().flatten().for_each(|&v| start[v as usize + 1] += 1);
    for v in 0..count {
        start[v + 1] += start[v];
    }
    let (mut fill, mut around) = (start.clone(), vec![0u32; corners.len() * 4]);
    for (t, own) in corners.iter().enumerate() {
        for &v in own {
            around[fill[v as usize] as usize] = t as u32;
            fill[v as usize] += 1;
        }
    }
    (start, around)
}
