//! Scene formats: one file and one row of `FORMATS` each.
