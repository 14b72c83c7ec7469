//! Checks of the global heaps, where HDF5 stores texts. The library (2.2.0) does not return from reading a
//! heap with a free-space object of size 0, so heaps are checked first.

use std::{
    collections::BTreeSet,
    fs,
    io::{self, Read, Seek, SeekFrom},
    path::Path,
};

use hdf5::{Dataset, types::TypeDescriptor};

use crate::declared::elements;

/// Size of a text in its dataset [bytes]: length, address of the heap, index of the object in it.
const REFERENCE: usize = 16;
/// Size of the header of a heap, and of an object in it [bytes].
const HEAD: usize = 16;

/// Fails if a heap with texts of a dataset is damaged; `path` is that of the file.
pub(crate) fn check_texts(dataset: &Dataset, path: &Path) -> hdf5::Result<()> {
    let count = elements(&dataset.get_shape()?);
    if count == 0 {
        return Ok(());
    }
    if dataset.is_chunked() || dataset.dtype()?.to_descriptor()? != TypeDescriptor::VarLenUnicode {
        return Err(format!("{} is not stored as haff stores texts", dataset.name()).into());
    }
    // A dataset that was never written has no address and reads as empty texts.
    let Some(address) = dataset.offset() else { return Ok(()) };
    let fail =
        |error: &dyn std::fmt::Display| -> hdf5::Error { format!("{}: {error}", dataset.name()).into() };
    let open = || -> io::Result<(fs::File, u64)> {
        let file = fs::File::open(path)?;
        let size = file.metadata()?.len();
        Ok((file, size))
    };
    let (mut file, size) = open().map_err(|error| fail(&error))?;
    let bytes = count.saturating_mul(REFERENCE as u64);
    let references = part(&mut file, size, address, bytes).map_err(|error| fail(&error))?;
    let heaps: BTreeSet<u64> =
        references.as_chunks::<REFERENCE>().0.iter().map(|reference| number(&reference[4..12])).collect();
    // An empty text has no heap.
    for heap in heaps.into_iter().filter(|&heap| heap != 0 && heap != u64::MAX) {
        let mut check = || -> io::Result<bool> {
            let head = part(&mut file, size, heap, HEAD as u64)?;
            let bytes = number(&head[8..]);
            let heap = part(&mut file, size, heap, bytes)?;
            Ok(head.starts_with(b"GCOL") && is_consistent(&heap))
        };
        if !check().map_err(|error| fail(&error))? {
            return Err(fail(&format_args!("the heap of texts at {heap} is damaged")));
        }
    }
    Ok(())
}

/// Whether each object of a heap ends where the next one begins.
fn is_consistent(heap: &[u8]) -> bool {
    let mut rest = heap.get(HEAD..).unwrap_or_default();
    while let Some(head) = rest.get(..HEAD) {
        let size = number(&head[8..]);
        // Object 0 is the free space; its size includes its header. Other objects are padded to 8 bytes.
        let free = head[..2] == [0; 2];
        let padded = size.checked_next_multiple_of(8).and_then(|size| size.checked_add(HEAD as u64));
        let whole = if free { size } else { padded.unwrap_or(0) };
        match usize::try_from(whole).ok().filter(|&whole| whole >= HEAD).and_then(|whole| rest.get(whole..)) {
            Some(after) => rest = after,
            None => return false,
        }
    }
    heap.len() >= HEAD
}

/// Reads a part of the file.
fn part(file: &mut fs::File, size: u64, start: u64, bytes: u64) -> io::Result<Vec<u8>> {
    if start.checked_add(bytes).is_none_or(|end| end > size) {
        let text = format!("{bytes} bytes at {start} in a file of {size} bytes");
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, text));
    }
    file.seek(SeekFrom::Start(start))?;
    let mut part = vec![0; bytes as usize];
    file.read_exact(&mut part)?;
    Ok(part)
}

/// A little-endian number of eight bytes.
fn number(bytes: &[u8]) -> u64 {
    bytes.first_chunk().map_or(u64::MAX, |bytes| u64::from_le_bytes(*bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heap_is_consistent_if_its_objects_fill_it() {
        let heap = |objects: &[(u16, u64)], length: usize| {
            let mut bytes = b"GCOL\x01\0\0\0".to_vec();
            bytes.extend((length as u64).to_le_bytes());
            for &(index, size) in objects {
                bytes.extend(index.to_le_bytes());
                bytes.extend([1, 0, 0, 0, 0, 0]);
                bytes.extend(size.to_le_bytes());
                let content =
                    if index == 0 { size.saturating_sub(16) } else { size.min(100).div_ceil(8) * 8 };
                bytes.extend(vec![7; content as usize]);
            }
            bytes.resize(length, 0);
            is_consistent(&bytes)
        };
        assert!(heap(&[(1, 5), (2, 8), (0, 24)], 16 + 24 + 24 + 24));
        // The remaining space is too small for the header of an object.
        assert!(heap(&[(1, 5)], 16 + 24 + 8));
        for damaged in
            [&[(1, 5), (0, 0)][..], &[(1, u64::MAX)], &[(1, u64::MAX - 15)], &[(1, 90), (2, 900)], &[(0, 8)]]
        {
            assert!(!heap(damaged, 200), "{damaged:?}");
        }
        assert!(!is_consistent(b"GCOL"));
    }
}
