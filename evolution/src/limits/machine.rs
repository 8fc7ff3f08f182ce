//! Memory and disk space of this machine.

use std::path::Path;
use sysinfo::{ProcessRefreshKind, ProcessesToUpdate, System};

/// Returns the memory that this process can still allocate: the minimum of the memory available in
/// the machine, in the process's cgroup and in its address space.
pub(super) fn memory_available() -> Option<u64> {
    let mut system = System::new().ok()?;
    system.refresh_memory();
    let machine = Some(system.available_memory()).filter(|&bytes| bytes > 0);
    let pid = sysinfo::get_current_pid().ok();
    let memory = ProcessRefreshKind::nothing().with_memory();
    let processes = ProcessesToUpdate::Some(pid.as_slice());
    system.refresh_processes_specifics(processes, false, memory);
    let process = pid.and_then(|pid| system.process(pid));
    // A cgroup can drop its page cache.
    let cgroup = process
        .and_then(|process| process.cgroup_limits())
        .map(|limits| limits.total_memory.saturating_sub(limits.rss));
    let in_use = process.map_or(0, |process| process.virtual_memory());
    let address_space = address_space_max().map(|most| most.saturating_sub(in_use));
    [machine, cgroup, address_space].into_iter().flatten().min()
}

#[cfg(unix)]
fn address_space_max() -> Option<u64> {
    use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
    let (most, _) = getrlimit(Resource::RLIMIT_AS).ok()?;
    (most != RLIM_INFINITY).then_some(most)
}

#[cfg(not(unix))]
fn address_space_max() -> Option<u64> {
    None
}

/// Returns the free bytes of the disk that holds a path; if the path does not exist, of the disk
/// that holds its nearest existing ancestor.
pub(super) fn disk_available(path: &Path) -> Option<u64> {
    let absolute = std::path::absolute(path).ok()?;
    let existing = absolute.ancestors().find(|path| path.exists())?;
    // A file system without a disk, such as /proc, reports no space.
    let disk = fs4::statvfs(existing).ok()?;
    (disk.total_space() > 0).then(|| disk.available_space())
}
