// The folder of a sweep: where everything is, how its runs stand, and who computes which. (docs/sweeps.md)
//
// All of it is files, so that launchers on several machines need nothing else in common: a run is done when its folder
// says so, and is computed by whoever holds the lock on its attempts.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/file_lock.h"
#include "pipelines/record/folder.h"
#include "pipelines/sweep/plan.h"

namespace hsi4d {

/// The paths of a sweep's members.
struct SweepPaths {
  std::filesystem::path folder;

  std::string plan() const { return (folder / "sweep.json").string(); }
  /// A plan as it was when runs were started by it: theirs are its indices, also once sweep.json is that of an edited
  /// file.
  std::string frozen_plan(const SweepPlan& plan) const;
  std::string log() const { return (folder / "sweep.log").string(); }
  std::string lock() const { return (folder / ".lock").string(); }
  std::string config(const std::string& id) const { return (folder / "configs" / (id + ".json")).string(); }
  std::string run(const std::string& id) const { return (folder / "runs" / id).string(); }
  std::string dataset(const std::string& id) const { return (folder / "data" / id).string(); }
  std::string attempts(const std::string& id) const { return (folder / "attempts" / (id + ".jsonl")).string(); }
  std::string printed(const std::string& id) const { return (folder / "logs" / (id + ".txt")).string(); }
  std::string csv() const { return (folder / "results.csv").string(); }
  std::string markdown() const { return (folder / "results.md").string(); }
  std::string report() const { return (folder / "report.html").string(); }
};

/// True for a folder that holds a sweep.
bool is_sweep_folder(const std::string& folder);

/// The folder of a plan's file: its own, or of one of plans/ that above.
std::filesystem::path sweep_folder_of(const std::filesystem::path& plan);

/// The plan that a folder holds. Throws UserError where there is none, DataError where it is damaged.
SweepPlan read_sweep_plan(const SweepPaths& paths);

/// The right to write the files of a sweep's folder itself: its plans, configs and results, not those of its runs. Held
/// for the moment, and waited for. Where it is taken, what others have left half done that were killed is removed.
class SweepFolderLock {
 public:
  /// Throws UserError where the folder cannot be made or written to.
  explicit SweepFolderLock(const SweepPaths& paths);

 private:
  FileLock lock_;
};

/// Writes the plan, a copy of it that stays, and the configs of its runs, of which those that are there already stay as
/// they are, unless they are damaged or of other settings than the run's. The plans are on the disk when this returns;
/// configs that a power cut damages are found out. Throws UserError naming the folder: it holds a sweep and `resume` is
/// false, something else, or cannot be written.
void write_sweep_plan(const SweepPaths& paths, const SweepPlan& plan, bool resume);

/// What write_sweep_plan would refuse, without writing anything.
void check_sweep_folder(const SweepPaths& paths, bool resume);

/// How a run of a sweep stands.
enum class SweepRunState { kNew, kStarted, kFailed, kDone, kLeftOut };

/// "new", "started", "failed", "done" or "left out".
std::string_view sweep_run_state_name(SweepRunState state);

/// How a run stands: done where its status says so and its summary is whole; else as its last attempt tells. Which ones
/// halving leaves out the plan tells too: sweep_run_states.
SweepRunState sweep_run_state(const SweepPaths& paths, const std::string& id);

/// True for a run that is done, has its report, and whose attempts tell of its end: nobody needs to start it again. A
/// kill may come between any two of these.
bool is_sweep_run_whole(const SweepPaths& paths, const std::string& id);

/// How far a run is that is not done: what its checkpoints are told by, other after every frame that is finished; of
/// its dataset, whether it is there.
std::string sweep_run_progress(const SweepPaths& paths, const SweepRun& run);

/// The program that computes: what a result is told by.
struct ProgramIdentity {
  std::string version, git, hash;  ///< hash: of the program's file
};

/// Of this program. Read once.
const ProgramIdentity& this_program();

/// A line of a run's attempts.
struct SweepAttempt {
  std::string event;  ///< "start", "done", "interrupted", "failed"
  std::string time, host, message;
  ProgramIdentity program;
  double seconds = 0, peak_mb = 0;  ///< of an end
};

/// The attempts at a run, in order. Lines that were cut short by a kill are passed over.
std::vector<SweepAttempt> read_attempts(const SweepPaths& paths, const std::string& id);

/// The right to compute a run, held by a lock on its attempts, which the system releases when the process ends.
class SweepClaim {
 public:
  /// Waits until no other process has it. Throws Interrupted when asked to stop, UserError where it cannot be written.
  SweepClaim(const SweepPaths& paths, const std::string& id, const std::function<bool()>& stop_requested);

  /// Without waiting: nothing where another process has it.
  static std::optional<SweepClaim> try_claim(const SweepPaths& paths, const std::string& id);

  /// Appends a line, with the time, host, process and program.
  void note(const std::string& event, const std::string& message = "", double seconds = 0, double peak_mb = 0);

 private:
  explicit SweepClaim(const std::string& file) : file_(file), lock_(file) {}

  std::string file_;
  FileLock lock_;
};

/// True while some process has the claim on a run.
bool is_claimed(const SweepPaths& paths, const std::string& id);

}  // namespace hsi4d
