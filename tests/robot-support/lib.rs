//! Code shared by the tests of slots, link and programs: a flash chip and a robot in memory.

pub mod flash;
pub mod full;
pub mod link_robot;
