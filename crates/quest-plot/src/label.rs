//! Labels that do not overlap.

/// Moves heights apart until neighbours differ by at least `gap`, in their order, as little as possible and within
/// `0..=height` where there is room.
pub(crate) fn spread(wanted: &[f64], gap: f64, height: f64) -> Vec<f64> {
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|&a, &b| wanted[a].total_cmp(&wanted[b]));
    // Blocks of labels that touch, each by the sum of its members' wanted beginnings and their number: a block
    // begins where its members are moved least in the mean square.
    let mut blocks: Vec<(f64, usize)> = Vec::new();
    let start = |&(sum, count): &(f64, usize)| {
        let room = (height - gap * (count - 1) as f64).max(0.0);
        (sum / count as f64).clamp(0.0, room)
    };
    for &index in &order {
        let mut block = (wanted[index], 1);
        while let Some(&last) = blocks.last() {
            let reach = gap * last.1 as f64;
            if start(&last) + reach <= start(&block) {
                break;
            }
            block = (last.0 + block.0 - reach * block.1 as f64, last.1 + block.1);
            blocks.pop();
        }
        blocks.push(block);
    }
    let mut placed = vec![0.0; wanted.len()];
    let mut next = order.into_iter();
    for block in &blocks {
        for k in 0..block.1 {
            if let Some(index) = next.next() {
                placed[index] = start(block) + gap * k as f64;
            }
        }
    }
    placed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_keep_their_distance_and_their_order() {
        let wanted = [50.0, 10.0, 11.0, 52.0, 51.0, 99.0, 100.0];
        let placed = spread(&wanted, 12.0, 100.0);
        let mut order: Vec<usize> = (0..wanted.len()).collect();
        order.sort_by(|&a, &b| wanted[a].total_cmp(&wanted[b]));
        for pair in order.windows(2) {
            assert!(placed[pair[1]] - placed[pair[0]] > 12.0 - 1e-9);
        }
        assert!(placed.iter().all(|p| (-1e-9..=100.0 + 1e-9).contains(p)), "{placed:?}");
        assert!((placed[4] - 51.0).abs() < 1e-9);
    }

    #[test]
    fn labels_with_room_stay() {
        assert_eq!(spread(&[40.0, 10.0], 12.0, 100.0), [40.0, 10.0]);
        assert!(spread(&[], 12.0, 100.0).is_empty());
    }
}
