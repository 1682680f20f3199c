//! Arrays of plain data one after another in a byte buffer, for messages between ranks of the same program.

use bytemuck::Pod;

/// Appends the length and the bytes of `values`.
pub(crate) fn put<T: Pod>(bytes: &mut Vec<u8>, values: &[T]) {
    bytes.extend_from_slice(&(values.len() as u64).to_le_bytes());
    bytes.extend_from_slice(bytemuck::cast_slice(values));
}

/// Reads back, in the same order, what [`put`] wrote.
pub(crate) struct Unpack<'a>(pub &'a [u8]);

impl Unpack<'_> {
    /// The next array. The bytes come from [`put`] on another rank, so a short buffer is a defect of this program.
    pub fn take<T: Pod>(&mut self) -> Vec<T> {
        let (length, rest) = self.0.split_at(8);
        let length: u64 = bytemuck::pod_read_unaligned(length);
        let mut values = vec![T::zeroed(); length as usize];
        let (bytes, rest) = rest.split_at(size_of_val(&values[..]));
        bytemuck::cast_slice_mut(&mut values).copy_from_slice(bytes);
        self.0 = rest;
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_come_back_in_order_whatever_their_alignment() {
        let mut bytes = Vec::new();
        put(&mut bytes, &[1u8, 2, 3]);
        put(&mut bytes, &[0.5f64, -2.0]);
        put::<u32>(&mut bytes, &[]);
        put(&mut bytes, &[[7u32, 8]]);
        let mut unpack = Unpack(&bytes);
        assert_eq!(unpack.take::<u8>(), [1, 2, 3]);
        assert_eq!(unpack.take::<f64>(), [0.5, -2.0]);
        assert!(unpack.take::<u32>().is_empty());
        assert_eq!(unpack.take::<[u32; 2]>(), [[7, 8]]);
        assert!(unpack.0.is_empty());
    }
}
