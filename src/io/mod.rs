//! Files: parse, validate, write.
