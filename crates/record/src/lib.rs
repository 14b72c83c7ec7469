//! H5MD files of haff: writer, reader, checkpoint.
