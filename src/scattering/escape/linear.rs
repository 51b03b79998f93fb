//! Linear equations.

/// Solves `matrix` x = `right` in place, for all columns of `right` at once: both row by row. Rows must not need to be swapped.
pub(super) fn solve(matrix: &mut [f64], right: &mut [f64], n: usize) {
    let columns = right.len() / n;
    for i in 0..n {
        let (done, later) = matrix.split_at_mut((i + 1) * n);
        let (right_done, right_later) = right.split_at_mut((i + 1) * columns);
        let (row, right_row) = (&done[i * n..], &right_done[i * columns..]);
        for (to, right_to) in later.chunks_exact_mut(n).zip(right_later.chunks_exact_mut(columns)) {
            let by = to[i] / row[i];
            if by != 0.0 {
                to[i + 1..].iter_mut().zip(&row[i + 1..]).for_each(|(to, from)| *to -= by * from);
                right_to.iter_mut().zip(right_row).for_each(|(to, from)| *to -= by * from);
            }
        }
    }
    for i in (0..n).rev() {
        let (before, after) = right.split_at_mut((i + 1) * columns);
        let row = &mut before[i * columns..];
        for (j, solved) in after.chunks_exact(columns).enumerate() {
            let by = matrix[i * n + i + 1 + j];
            row.iter_mut().zip(solved).for_each(|(to, from)| *to -= by * from);
        }
        row.iter_mut().for_each(|to| *to /= matrix[i * n + i]);
    }
}
