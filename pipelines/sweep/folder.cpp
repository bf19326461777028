#include "pipelines/sweep/folder.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <unistd.h>

#include "core/check.h"
#include "core/disk.h"
#include "core/file.h"
#include "core/host.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/observer.h"
#include "core/system_message.h"
#include "core/version.h"
#include "optim/checkpoint.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kBetweenTries{200};
constexpr std::chrono::milliseconds kShortly{20};  // others look whether a run is claimed for less than that
constexpr int kShortTries = 5;

double number_member(const ConfigValue& object, std::string_view key) {
  const ConfigValue* const member = find_member(object, key);
  return member == nullptr || member->kind != ConfigValue::Kind::kNumber ? 0 : number_of(*member, key);
}

bool has_whole_summary(const RunPaths& paths) {
  try {
    return fs::exists(paths.summary()) &&
           !parse_summary(read_text_file(paths.summary()), paths.summary()).metrics.empty();
  } catch (const DataError&) {
    return false;
  }
}

std::string state_in(const RunPaths& paths) {
  try {
    return string_member(parse_json_text(read_text_file(paths.status()), paths.status()), "state");
  } catch (const DataError&) {
    return "";
  }
}

/// Makes a folder with those that it is in.
void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw UserError(folder.string() + ": the folder cannot be made: " + error.message());
}

/// The file of the lock on a sweep's folder, which is there.
std::string placed_lock(const SweepPaths& paths) {
  make_folder(paths.folder);
  return paths.lock();
}

/// The file of a run's attempts, whose folder is there.
std::string placed_attempts(const SweepPaths& paths, const std::string& id) {
  const std::string file = paths.attempts(id);
  make_folder(fs::path(file).parent_path());
  return file;
}

void warn_without_locks(FileLock::State state, const std::string& file) {
  if (state == FileLock::State::kNoLocks)
    log_warning(file +
                ": this file system has no locks: two processes that compute this run would not notice each other");
}

/// Whether the config that a folder has of a run is that of the run.
bool has_config(const SweepPaths& paths, const SweepRun& run) {
  const std::string file = paths.config(run.id);
  if (!fs::exists(file)) return false;
  const std::string text = read_text_file(file);
  try {
    if (text == run.config || sweep_run_id(text, file, !run.dataset.empty()) == run.id) return true;
    log_warning(file + ": has other settings than the run; it is written anew");
  } catch (const DataError& damage) {
    log_warning(std::string(damage.what()) + "; the file is written anew");
  }
  return false;
}

/// True for a folder that holds nothing but what write_sweep_plan writes before the plan: whoever wrote it was killed.
bool is_begun_sweep(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    const bool is_own = name == "configs" || name == "attempts" || name == "logs" || name == "runs" ||
                        name == "plans" || name == ".lock" || name.ends_with(".tmp");
    if (!is_own) return false;
  }
  return !error;
}

}  // namespace

std::string SweepPaths::frozen_plan(const SweepPlan& plan) const {
  return (folder / "plans" / (text_hash(sweep_plan_json(plan)) + ".json")).string();
}

fs::path sweep_folder_of(const fs::path& plan) {
  const fs::path whole = fs::absolute(plan).lexically_normal();
  const bool is_frozen = whole.parent_path().filename() == "plans";
  if (is_frozen) return whole.parent_path().parent_path();
  return plan.has_parent_path() ? plan.parent_path() : fs::path(".");
}

bool is_sweep_folder(const std::string& folder) {
  const SweepPaths paths{folder};
  std::error_code error;
  if (!fs::is_regular_file(paths.plan(), error)) return false;
  try {
    return is_sweep_plan(parse_json_text(read_text_file(paths.plan()), paths.plan()));
  } catch (const DataError&) {
    return fs::is_directory(fs::path(folder) / "configs", error);  // damaged: reading it tells how
  }
}

SweepPlan read_sweep_plan(const SweepPaths& paths) {
  return parse_sweep_plan(read_text_file(paths.plan()), paths.plan());
}

void check_sweep_folder(const SweepPaths& paths, bool resume) {
  const std::string folder = paths.folder.string();
  std::error_code error;
  if (!fs::exists(paths.folder, error) || fs::is_empty(paths.folder, error)) return;
  if (!is_begun_sweep(paths.folder) && !is_sweep_folder(folder))  // in this order: it may become whole meanwhile
    throw UserError(folder + ": holds something that is no sweep; choose another folder");
  if (!resume)
    throw UserError(folder + ": holds a sweep already; --resume goes on with it, another --out makes a new one");
}

SweepFolderLock::SweepFolderLock(const SweepPaths& paths) : lock_(placed_lock(paths)) {
  if (lock_.wait({}, {}) != FileLock::State::kHeld) return;  // without locks nobody knows what is still being written
  for (const char* const name : {"", "plans", "configs", "slurm"})
    remove_temporary_files((paths.folder / name).string());
}

void write_sweep_plan(const SweepPaths& paths, const SweepPlan& plan, bool resume) {
  check_sweep_folder(paths, resume);
  const SweepFolderLock lock(paths);
  check_sweep_folder(paths, resume || !is_sweep_folder(paths.folder.string()));  // as it is now that nobody else writes
  for (const char* const name : {"configs", "plans", "attempts", "logs", "runs"}) make_folder(paths.folder / name);
  for (const SweepRun& run : plan.runs) {
    if (!run.config.empty() && !has_config(paths, run)) write_text_file(paths.config(run.id), run.config);
  }
  const std::string text = sweep_plan_json(plan);
  write_text_file(paths.frozen_plan(plan), text);
  write_text_file(paths.plan(), text);  // last: with it the folder is whole
  for (const std::string& file : {paths.frozen_plan(plan), paths.plan()}) sync_to_disk(file);
}

std::string_view sweep_run_state_name(SweepRunState state) {
  switch (state) {
    case SweepRunState::kNew:
      return "new";
    case SweepRunState::kStarted:
      return "started";
    case SweepRunState::kFailed:
      return "failed";
    case SweepRunState::kDone:
      return "done";
    case SweepRunState::kLeftOut:
      return "left out";
  }
  return "";
}

SweepRunState sweep_run_state(const SweepPaths& paths, const std::string& id) {
  const RunPaths run{paths.run(id)};
  const bool has_status = fs::exists(run.status());
  const std::string state = has_status ? state_in(run) : "";
  if (state == run_state_name(RunState::kDone) && has_whole_summary(run)) return SweepRunState::kDone;
  const std::vector<SweepAttempt> attempts = read_attempts(paths, id);
  const bool has_failed =
      attempts.empty() ? state == run_state_name(RunState::kFailed) : attempts.back().event == "failed";
  if (has_failed) return SweepRunState::kFailed;
  return has_status || !attempts.empty() ? SweepRunState::kStarted : SweepRunState::kNew;
}

bool is_sweep_run_whole(const SweepPaths& paths, const std::string& id) {
  if (sweep_run_state(paths, id) != SweepRunState::kDone || !fs::exists(RunPaths{paths.run(id)}.report())) return false;
  const std::vector<SweepAttempt> attempts = read_attempts(paths, id);
  return attempts.empty() || attempts.back().event == "done";
}

std::string sweep_run_progress(const SweepPaths& paths, const SweepRun& run) {
  std::string told = !run.dataset.empty() && fs::exists(paths.dataset(run.dataset)) ? "dataset\n" : "";
  std::vector<std::string> checkpoints;
  std::error_code error;
  for (fs::recursive_directory_iterator it(paths.run(run.id), error), end; !error && it != end; it.increment(error)) {
    if (it->path().parent_path().filename() != "checkpoint") continue;
    const auto written = it->last_write_time(error);
    if (!error) checkpoints.push_back(it->path().string() + " " + std::to_string(written.time_since_epoch().count()));
    error.clear();
  }
  std::sort(checkpoints.begin(), checkpoints.end());
  for (const std::string& checkpoint : checkpoints) told += checkpoint + "\n";
  return told;
}

const ProgramIdentity& this_program() {
  static const ProgramIdentity identity = [] {
    ProgramIdentity program{version(), git_commit(), "unknown"};
    try {
      program.hash = text_hash(read_text_file("/proc/self/exe"));
    } catch (const UserError&) {  // no /proc: version and commit tell enough
    }
    return program;
  }();
  return identity;
}

std::vector<SweepAttempt> read_attempts(const SweepPaths& paths, const std::string& id) {
  std::vector<SweepAttempt> attempts;
  const std::string file = paths.attempts(id);
  if (!fs::exists(file)) return attempts;
  const std::string text = read_text_file(file);
  for (std::size_t begin = 0, end = 0; begin < text.size(); begin = end + 1) {
    end = std::min(text.find('\n', begin), text.size());
    try {
      const ConfigValue line = parse_json_text(text.substr(begin, end - begin), file);
      SweepAttempt attempt;
      attempt.event = string_member(line, "event");
      attempt.time = string_member(line, "time");
      attempt.host = string_member(line, "host");
      attempt.message = string_member(line, "message");
      attempt.program = {string_member(line, "version"), string_member(line, "git"), string_member(line, "program")};
      attempt.seconds = number_member(line, "seconds");
      attempt.peak_mb = number_member(line, "peak_mb");
      if (!attempt.event.empty()) attempts.push_back(std::move(attempt));
    } catch (const DataError&) {  // cut short by a kill
    }
  }
  return attempts;
}

SweepClaim::SweepClaim(const SweepPaths& paths, const std::string& id, const std::function<bool()>& stop_requested)
    : SweepClaim(placed_attempts(paths, id)) {
  const auto tell = [&] { log_info("run " + id + ": another process computes it; waits for that"); };
  const FileLock::State state = lock_.wait(stop_requested, tell, kBetweenTries);
  if (state == FileLock::State::kBusy) throw Interrupted("interrupted while another process computed run " + id);
  warn_without_locks(state, file_);
}

std::optional<SweepClaim> SweepClaim::try_claim(const SweepPaths& paths, const std::string& id) {
  SweepClaim claim(placed_attempts(paths, id));
  int tries = 0;
  const FileLock::State state = claim.lock_.wait([&tries] { return ++tries >= kShortTries; }, {}, kShortly);
  if (state == FileLock::State::kBusy) return std::nullopt;
  warn_without_locks(state, claim.file_);
  return claim;
}

void SweepClaim::note(const std::string& event, const std::string& message, double seconds, double peak_mb) {
  ConfigValue line = ConfigValue::make_object();
  line.add("event", ConfigValue::make_string(event));
  line.add("time", ConfigValue::make_string(utc_now_text()));
  line.add("host", ConfigValue::make_string(host_name()));
  line.add("process", ConfigValue::make_integer(::getpid()));
  if (const char* const job = std::getenv("SLURM_JOB_ID")) line.add("slurm_job", ConfigValue::make_string(job));
  const ProgramIdentity& program = this_program();
  line.add("version", ConfigValue::make_string(program.version));
  line.add("git", ConfigValue::make_string(program.git));
  line.add("program", ConfigValue::make_string(program.hash));
  if (seconds > 0) line.add("seconds", ConfigValue::make_number(std::round(seconds * 1000) / 1000));
  if (peak_mb > 0) line.add("peak_mb", ConfigValue::make_number(std::round(peak_mb * 10) / 10));
  if (!message.empty()) line.add("message", ConfigValue::make_string(message));
  std::string text = to_json_line(line) + "\n";
  char last = '\n';
  const off_t size = ::lseek(lock_.descriptor(), 0, SEEK_END);
  if (size > 0 && ::pread(lock_.descriptor(), &last, 1, size - 1) == 1 && last != '\n') text.insert(text.begin(), '\n');
  if (::write(lock_.descriptor(), text.data(), text.size()) != static_cast<ssize_t>(text.size()))
    throw UserError(file_ + ": cannot be written: " + system_message(errno));
}

bool is_claimed(const SweepPaths& paths, const std::string& id) { return is_file_locked(paths.attempts(id)); }

}  // namespace hsi4d
