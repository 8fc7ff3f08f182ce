//! What the tests of slots, link and programs share: a flash chip and a robot in memory.

pub mod flash;
pub mod full;
pub mod link_robot;
