//! Every time the glove waits for.
