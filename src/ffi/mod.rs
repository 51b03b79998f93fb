//! The fence.
#![allow(unsafe_code, reason = "the only room that talks to C and C++; every block says why it is sound")]

pub mod embree;
