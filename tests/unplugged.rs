//! The robot's plug is pulled while a genome is written to it over the line.

use minimal_surprise_controller::KERNEL_ID;
use minimal_surprise_link::{Reply, Request};
use tests::firmware;
use tests::robot::{Line, QemuRobot};
use tests::tools::require;

#[test]
fn a_robot_fresh_from_the_factory_says_who_it_is() {
    let Some(firmware) = require(firmware::build()) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let Some(robot) = require(QemuRobot::start(&firmware, folder.path())) else {
        return;
    };
    let mut line = Line::open(&robot.port, 1).unwrap();
    line.ask(&Request::Identify, |reply| match reply {
        Reply::Identity(identity) => {
            println!("{identity:?}");
            assert_eq!((identity.firmware, identity.kernel), ("robot", KERNEL_ID));
        }
        other => panic!("{other:?}"),
    })
    .unwrap();
    robot.kill();
}
