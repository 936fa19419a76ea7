//! Where bytes are equal, by many at a time.

/// Neighbouring equal bytes, from left to right.
pub(crate) fn equal_runs(mut bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let run;
        (run, bytes) = bytes.split_at(equal_prefix(bytes, *bytes.first()?));
        Some(run)
    })
}

/// How many entries at the start of `kinds` are `kind`: by 64, by 8 and one by one, because rows are mostly long runs.
pub(super) fn equal_prefix(kinds: &[u8], kind: u8) -> usize {
    // not `==` of arrays, which calls the C library
    let differ = |cells: &[u8; 64]| cells.iter().fold(0, |any, &cell| any | (cell ^ kind));
    let long = 64 * kinds.as_chunks::<64>().0.iter().take_while(|cells| differ(cells) == 0).count();
    let short = kinds[long..].as_chunks::<8>().0.iter().take_while(|&&cells| cells == [kind; 8]).count();
    let done = long + 8 * short;
    done + kinds[done..].iter().take_while(|&&cell| cell == kind).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_equal_bytes_leave_none_out() {
        let lengths = [1, 7, 8, 9, 63, 64, 65, 200, 1];
        let bytes: Vec<u8> = lengths
            .iter()
            .enumerate()
            .flat_map(|(nth, &length)| std::iter::repeat_n((nth % 2) as u8, length))
            .collect();
        assert!(equal_runs(&bytes).map(<[u8]>::len).eq(lengths));
        assert!(equal_runs(&bytes).flatten().eq(&bytes));
        assert_eq!(equal_runs(&[]).count(), 0);
    }
}
