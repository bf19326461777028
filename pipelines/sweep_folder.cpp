#include "pipelines/sweep_folder.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fcntl.h>
#include <sys/file.h>
#include <thread>
#include <unistd.h>

#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "core/system_message.h"
#include "core/version.h"
#include "optim/checkpoint.h"
#include "pipelines/json_text.h"
#include "pipelines/observer.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kBetweenTries{200};

std::string now_text() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  std::array<char, 32> buffer{};
  return {buffer.data(), std::strftime(buffer.data(), buffer.size(), "%Y-%m-%dT%H:%M:%SZ", &parts)};
}

std::string host_name() {
  std::array<char, 256> buffer{};
  return ::gethostname(buffer.data(), buffer.size() - 1) == 0 ? buffer.data() : "unknown";
}

/// Opens the file of attempts. −1: it is not there, or cannot be written.
int open_attempts(const std::string& file, int flags) {
  return ::open(file.c_str(), O_RDWR | O_APPEND | O_CLOEXEC | flags, 0666);
}

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

/// True for a folder that holds nothing but what write_sweep_plan writes before the plan: whoever wrote it was killed.
bool is_begun_sweep(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    const bool is_own = name == "configs" || name == "attempts" || name == "logs" || name == "runs" ||
                        name == "plans" || name.ends_with(".tmp");
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
  if (!is_sweep_folder(folder) && !is_begun_sweep(paths.folder))
    throw UserError(folder + ": holds something that is no sweep; choose another folder");
  if (!resume)
    throw UserError(folder + ": holds a sweep already; --resume goes on with it, another --out makes a new one");
}

void write_sweep_plan(const SweepPaths& paths, const SweepPlan& plan, bool resume) {
  check_sweep_folder(paths, resume);
  for (const SweepRun& run : plan.runs) {
    if (!run.config.empty() && !fs::exists(paths.config(run.id))) write_text_file(paths.config(run.id), run.config);
  }
  std::error_code error;
  for (const char* const name : {"attempts", "logs", "runs"}) {
    fs::create_directories(paths.folder / name, error);
    if (error) throw UserError((paths.folder / name).string() + ": the folder cannot be made: " + error.message());
  }
  const std::string text = sweep_plan_json(plan);
  write_text_file(paths.frozen_plan(plan), text);
  write_text_file(paths.plan(), text);  // last: with it the folder is whole
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
  }
  return "";
}

SweepRunState sweep_run_state(const SweepPaths& paths, const std::string& id) {
  const RunPaths run{paths.run(id)};
  if (fs::exists(run.status())) {
    const std::string state = state_in(run);
    if (state == run_state_name(RunState::kDone) && has_whole_summary(run)) return SweepRunState::kDone;
    if (state != run_state_name(RunState::kFailed)) return SweepRunState::kStarted;
  }
  const std::vector<SweepAttempt> attempts = read_attempts(paths, id);
  if (attempts.empty()) return SweepRunState::kNew;
  return attempts.back().event == "failed" ? SweepRunState::kFailed : SweepRunState::kStarted;
}

bool is_sweep_run_whole(const SweepPaths& paths, const std::string& id) {
  return sweep_run_state(paths, id) == SweepRunState::kDone && fs::exists(RunPaths{paths.run(id)}.report());
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
    : file_(paths.attempts(id)) {
  std::error_code error;
  fs::create_directories(fs::path(file_).parent_path(), error);
  descriptor_ = open_attempts(file_, O_CREAT);
  if (descriptor_ < 0) throw UserError(file_ + ": cannot be written: " + system_message(errno));
  for (bool has_told = false; ::flock(descriptor_, LOCK_EX | LOCK_NB) != 0;) {
    if (errno != EWOULDBLOCK) {
      log_warning(file_ + ": this file system has no locks (" + system_message(errno) +
                  "): two processes that compute this run would not notice each other");
      return;
    }
    if (!has_told) log_info("run " + id + ": another process computes it; waits for that");
    has_told = true;
    if (stop_requested && stop_requested()) {
      ::close(descriptor_);
      throw Interrupted("interrupted while another process computed run " + id);
    }
    std::this_thread::sleep_for(kBetweenTries);
  }
}

SweepClaim::~SweepClaim() { ::close(descriptor_); }

void SweepClaim::note(const std::string& event, const std::string& message, double seconds, double peak_mb) {
  ConfigValue line = ConfigValue::make_object();
  line.add("event", ConfigValue::make_string(event));
  line.add("time", ConfigValue::make_string(now_text()));
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
  const off_t size = ::lseek(descriptor_, 0, SEEK_END);
  if (size > 0 && ::pread(descriptor_, &last, 1, size - 1) == 1 && last != '\n') text.insert(text.begin(), '\n');
  if (::write(descriptor_, text.data(), text.size()) != static_cast<ssize_t>(text.size()))
    throw UserError(file_ + ": cannot be written: " + system_message(errno));
}

bool is_claimed(const SweepPaths& paths, const std::string& id) {
  const int descriptor = open_attempts(paths.attempts(id), 0);
  if (descriptor < 0) return false;
  const bool is_taken = ::flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(descriptor);
  return is_taken;
}

}  // namespace hsi4d
