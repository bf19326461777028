#include "pipelines/sweep/local.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <deque>
#include <filesystem>
#include <fstream>
#include <list>
#include <map>
#include <optional>
#include <set>
#include <thread>
#include <unistd.h>
#include <utility>

#include "core/background_program.h"
#include "core/check.h"
#include "core/exit_status.h"
#include "core/file.h"
#include "core/observer.h"
#include "core/process.h"
#include "core/text.h"
#include "pipelines/sweep/halving.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kLook{50};           // between looks at what has ended
constexpr std::chrono::milliseconds kBetweenLooks{500};  // between looks at what other launchers compute
constexpr double kBetweenReports = 1;                    // seconds
constexpr std::int64_t kEndOfOutput = 4096;              // bytes
constexpr int kInterruptSignal = SIGINT;  // not SIGTERM, which they get when we are killed: a second one would end them

/// A run that is being computed.
struct Running {
  std::size_t index;
  std::int64_t printed_before;  ///< bytes of its file of output that are of earlier attempts
  std::size_t noted_before;     ///< lines of its attempts that are
  BackgroundProgram program;

  Running(std::size_t run, std::int64_t printed, std::size_t noted, const std::vector<std::string>& command,
          const std::string& output)
      : index(run), printed_before(printed), noted_before(noted), program(command, output) {}
};

std::int64_t size_of(const std::string& file) {
  std::error_code error;
  const auto size = fs::file_size(file, error);
  return error ? 0 : static_cast<std::int64_t>(size);
}

/// What a run has printed last, in this attempt.
std::string end_of_printed(const std::string& file, std::int64_t before) {
  std::ifstream stream(file, std::ios::binary);
  stream.seekg(std::max(before, size_of(file) - kEndOfOutput));
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The share of its work that a run has told last ("..., 40%, ..."); 0 where it has told none.
double told_share(const std::string& printed) {
  for (std::size_t at = printed.rfind("%,"); at != std::string::npos && at > 0; at = printed.rfind("%,", at - 1)) {
    std::size_t begin = at;
    while (begin > 0 && printed[begin - 1] >= '0' && printed[begin - 1] <= '9') --begin;
    if (begin < at) return std::min(1.0, std::stod(printed.substr(begin, at - begin)) / 100);
  }
  return 0;
}

class Launcher {
 public:
  Launcher(const SweepPaths& paths, const SweepPlan& plan, const SweepLaunch& launch)
      : paths_(paths),
        plan_(plan),
        launch_(launch),
        frozen_plan_(paths.frozen_plan(plan)),
        jobs_(static_cast<std::size_t>(sweep_jobs(plan, launch))),
        begin_(Clock::now()),
        turns_(plan, done_metrics(paths, plan)) {}

  SweepOutcome run() {
    for (const std::size_t index : distinct_runs(plan_)) {
      ++total_;
      if (is_sweep_run_whole(paths_, id_of(index))) {
        ++outcome_.done_before;
      } else {
        waiting_.push_back(index);
      }
      learn_from(read_attempts(paths_, id_of(index)));
    }
    for (const std::size_t index : waiting_) open_.insert(id_of(index));
    if (outcome_.done_before > 0)
      tell(std::to_string(outcome_.done_before) + " of " + std::to_string(total_) + " runs are done already");
    try {
      while (go_on()) std::this_thread::sleep_for(kLook);
    } catch (...) {
      interrupt_all();  // with their state saved, whatever has happened here
      throw;
    }
    report(true);
    return std::move(outcome_);
  }

 private:
  const std::string& id_of(std::size_t index) const { return plan_.runs[index].id; }
  std::string label_of(std::size_t index) const { return sweep_label(plan_.runs[index]); }
  void tell(const std::string& line) const {
    if (launch_.tell) launch_.tell(line);
  }

  /// One look at everything. False once there is nothing more to do.
  bool go_on() {
    collect_ended();
    if (launch_.stop_requested && launch_.stop_requested()) stop();
    if (launch_.fail_fast && !outcome_.failures.empty()) {
      give_up();
      return false;
    }
    start_what_fits();
    report(false);
    return !(running_.empty() && waiting_.empty());
  }

  // ---- Memory and time, as far as they are known ----

  void learn_from(const std::vector<SweepAttempt>& attempts) {
    for (const SweepAttempt& attempt : attempts) {
      known_peak_mb_ = std::max(known_peak_mb_, attempt.peak_mb);
      if (attempt.event == "done" && attempt.seconds > 0) note_seconds(attempt.seconds);
    }
  }

  void note_seconds(double seconds) {
    seconds_sum_ += seconds;
    ++seconds_count_;
  }

  /// What a run will take: what the sweep says, or the most that one of its runs has taken; twice as much after each
  /// time that it was killed for memory.
  double needed_mb(std::size_t index) const {
    const auto killed = killed_.find(id_of(index));
    return std::ldexp(std::max(plan_.memory_mb, known_peak_mb_), killed == killed_.end() ? 0 : killed->second);
  }

  bool has_memory_for(std::size_t index) {
    if (launch_.memory_mb <= 0) return true;
    if (running_.empty()) {
      if (needed_mb(index) > launch_.memory_mb) warn_of_memory(needed_mb(index));
      return true;
    }
    double taken = needed_mb(index);
    for (const Running& run : running_) taken += needed_mb(run.index);
    return taken <= launch_.memory_mb;
  }

  void warn_of_memory(double needed_mb) {
    if (std::exchange(has_warned_of_memory_, true)) return;
    tell("a run takes up to " + rounded(needed_mb, 3) + " MB, and there are " + rounded(launch_.memory_mb, 3) +
         " MB for all together: one at a time is computed, and may end for want of memory");
  }

  /// Seconds until all is done; negative: not known.
  double seconds_left() const {
    double mean = seconds_count_ > 0 ? seconds_sum_ / static_cast<double>(seconds_count_) : 0, left = 0;
    for (const Running& run : running_) {
      const double share = told_share(end_of_printed(paths_.printed(id_of(run.index)), run.printed_before));
      const double seconds = run.program.seconds();
      if (share > 0 && seconds_count_ == 0) mean = std::max(mean, seconds / share);
      left += share > 0 ? seconds * (1 / share - 1) : std::max(0.0, mean - seconds);
    }
    if (mean == 0) return -1;
    left += mean * static_cast<double>(waiting_.size());
    return left / static_cast<double>(std::max<std::size_t>(1, std::min(jobs_, running_.size() + waiting_.size())));
  }

  std::size_t ended() const {
    return outcome_.done_before + outcome_.computed + outcome_.by_others + outcome_.failures.size() +
           outcome_.left_out + outcome_.over_budget;
  }

  void report(bool is_finished) {
    if (!launch_.progress) return;
    const double now = std::chrono::duration<double>(Clock::now() - begin_).count();
    if (!is_finished && now - last_report_ < kBetweenReports && last_report_ > 0) return;
    last_report_ = now;
    ProgressState state;
    const std::string task = plan_.name + " (" + std::to_string(running_.size()) + " running)";
    state.task = is_finished ? plan_.name : task;
    state.done = static_cast<std::int64_t>(ended());
    state.total = static_cast<std::int64_t>(total_);
    state.seconds = now;
    state.seconds_left = seconds_left();
    state.is_finished = is_finished;
    launch_.progress(state);
  }

  // ---- Starting ----

  /// A run whose dataset another one is making right now would only wait for it.
  bool waits_for_dataset(std::size_t index) const {
    const std::string& dataset = plan_.runs[index].dataset;
    if (dataset.empty() || fs::exists(paths_.dataset(dataset))) return false;
    return std::any_of(running_.begin(), running_.end(),
                       [&](const Running& run) { return plan_.runs[run.index].dataset == dataset; });
  }

  /// What is waiting when the hours of the sweep are over is not started any more.
  bool stops_for_budget(const std::function<bool(std::size_t)>& may_end) {
    if (waiting_.empty() || running_.size() >= jobs_ || !is_over_budget(paths_, plan_)) return false;
    for (const std::size_t index : waiting_) {
      const bool is_left_out = turns_.turn(index, may_end) == SweepTurn::kNever;
      ++(is_left_out ? outcome_.left_out : outcome_.over_budget);
    }
    waiting_.clear();
    if (outcome_.over_budget > 0)
      tell("the sweep's " + number_text(plan_.hours) + " h are spent: " + std::to_string(outcome_.over_budget) +
           (outcome_.over_budget == 1 ? " run is" : " runs are") + " not started");
    return true;
  }

  void start_what_fits() {
    if (running_.size() == running_before_ && Clock::now() < next_try_) return;  // nothing has changed since
    next_try_ = Clock::now() + kBetweenLooks;
    for (Running& run : running_) known_peak_mb_ = std::max(known_peak_mb_, run.program.peak_mb());
    const auto may_end = [this](std::size_t run) { return open_.contains(id_of(run)); };
    if (stops_for_budget(may_end)) return;
    for (auto it = waiting_.begin(); it != waiting_.end() && running_.size() < jobs_;) {
      const std::size_t index = *it;
      const SweepTurn turn = turns_.turn(index, may_end);
      if (turn == SweepTurn::kNever) {
        it = waiting_.erase(it);
        open_.erase(id_of(index));
        ++outcome_.left_out;
      } else if (turn == SweepTurn::kLater || !has_memory_for(index) || is_claimed(paths_, id_of(index)) ||
                 waits_for_dataset(index)) {
        ++it;
      } else if (is_sweep_run_whole(paths_, id_of(index))) {  // since we looked
        it = waiting_.erase(it);
        open_.erase(id_of(index));
        ++outcome_.by_others;
        tell_end(index, "was done by another launcher");
      } else {
        it = waiting_.erase(it);
        start(index);
      }
    }
    running_before_ = running_.size();
  }

  void start(std::size_t index) {
    const std::string output = paths_.printed(id_of(index));
    try {
      running_.emplace_back(
          index, size_of(output), read_attempts(paths_, id_of(index)).size(),
          std::vector<std::string>{launch_.program, "run-one", frozen_plan_, std::to_string(index), "--out",
                                   paths_.folder.string(), "--threads", std::to_string(sweep_threads(plan_, launch_)),
                                   "--parent", std::to_string(::getpid())},
          output);
    } catch (const UserError& problem) {  // of this run alone: the others go on
      note_attempt(index, problem.what(), 0, 0);
      add_failure({index, problem.what(), false});
    }
  }

  // ---- Ends ----

  void collect_ended() {
    for (auto it = running_.begin(); it != running_.end();) {
      const std::optional<ProgramEnd> end = it->program.ended();
      if (!end) {
        ++it;
        continue;
      }
      note_end(*it, *end);
      it = running_.erase(it);
    }
  }

  void note_end(const Running& run, const ProgramEnd& end) {
    known_peak_mb_ = std::max(known_peak_mb_, end.peak_mb);
    const bool has_ended_itself = end.signal == 0;
    if (has_ended_itself && end.status == exit_status::kElsewhere) return waiting_.push_back(run.index);
    if (has_ended_itself && end.status == exit_status::kDone && is_sweep_run_whole(paths_, id_of(run.index)))
      return note_done(run, end);
    const bool is_interrupted =
        has_ended_itself ? end.status == exit_status::kInterrupted : end.signal == kInterruptSignal;
    if (is_stopping_ && is_interrupted) return interrupted_.push_back(run.index);
    const std::vector<SweepAttempt> attempts = read_attempts(paths_, id_of(run.index));
    const bool has_noted = attempts.size() > run.noted_before && attempts.back().event == "failed";
    const std::string message = has_noted ? attempts.back().message : failure_text(run, end);
    if (!has_noted) note_attempt(run.index, message, run.program.seconds(), end.peak_mb);
    if (end.signal == SIGKILL && killed_[id_of(run.index)] < plan_.memory_retries) return retry(run.index, message);
    add_failure({run.index, message, end.status == exit_status::kOurBug});
  }

  /// With twice the memory, behind all that wait.
  void retry(std::size_t index, const std::string& message) {
    ++killed_[id_of(index)];
    waiting_.push_back(index);
    tell_end(index, message + "; it is computed again, with " + rounded(needed_mb(index), 3) + " MB");
  }

  void note_done(const Running& run, const ProgramEnd& end) {
    open_.erase(id_of(run.index));
    ++outcome_.computed;
    note_seconds(run.program.seconds());
    tell_end(run.index, "done in " + duration_text(run.program.seconds()) +
                            (end.peak_mb > 0 ? ", " + rounded(end.peak_mb, 3) + " MB" : "") + main_error(run.index));
  }

  void add_failure(SweepFailure failure) {
    open_.erase(id_of(failure.index));
    outcome_.failures.push_back(std::move(failure));
    tell_end(outcome_.failures.back().index, "failed: " + outcome_.failures.back().message);
  }

  /// Notes the end of a run that could not do so itself, unless another process has gone on with it since.
  void note_attempt(std::size_t index, const std::string& message, double seconds, double peak_mb) const {
    try {
      std::optional<SweepClaim> claim = SweepClaim::try_claim(paths_, id_of(index));
      if (claim) claim->note("failed", message, seconds, peak_mb);
    } catch (const UserError&) {  // a full disk, perhaps: it is told all the same
    }
  }

  /// "5/24 LABEL: WHAT; 3:10 left".
  void tell_end(std::size_t index, const std::string& what) {
    const std::size_t done = ended();
    const double left = seconds_left();
    tell(std::to_string(done) + "/" + std::to_string(total_) + " run " + std::to_string(index) + ", " +
         label_of(index) + ": " + what + (left >= 0 && done < total_ ? "; " + duration_text(left) + " left" : ""));
  }

  /// The first error of its last stage that has one, ", world MPJPE 31.2 mm".
  std::string main_error(std::size_t index) const {
    const std::string file = RunPaths{paths_.run(id_of(index))}.summary();
    const RunSummary summary = parse_summary(read_text_file(file), file);  // whole: looked at before
    for (const char* const name : {"world_mpjpe_mm", "psnr_db", "camera_translation_cm"}) {
      const MetricFacts* const facts = find_metric_facts(name);
      if (const double* const value = find_metric(summary.metrics.back().values, name))
        return ", " + std::string(facts->label) + " " + fixed_number(*value, facts->decimals) + " " +
               std::string(facts->unit);
    }
    return "";
  }

  std::string failure_text(const Running& run, const ProgramEnd& end) const {
    const std::string printed = end_of_output(end_of_printed(paths_.printed(id_of(run.index)), run.printed_before));
    if (!end.is_known) return "ended without results, and the system does not tell how" + printed;
    if (end.signal == SIGKILL)
      return "was ended by signal 9, most often for want of memory (it had " + rounded(end.peak_mb, 3) + " MB)" +
             printed;
    if (end.signal != 0) return "was ended by signal " + std::to_string(end.signal) + printed;
    if (end.status == exit_status::kDone) return "ended as if it were done, and its results are not whole" + printed;
    return "ended with status " + std::to_string(end.status) + printed;
  }

  // ---- Stopping ----

  /// Interrupts what is running and waits until it has saved its state.
  void interrupt_all() {
    is_stopping_ = true;
    for (const Running& run : running_) run.program.send(kInterruptSignal);
    while (!running_.empty()) {
      collect_ended();
      std::this_thread::sleep_for(kLook);
    }
  }

  [[noreturn]] void stop() {
    interrupt_all();
    report(true);
    throw Interrupted("interrupted: " + std::to_string(ended()) + " of " + std::to_string(total_) +
                      " runs have ended, others have saved their state");
  }

  void give_up() {
    interrupt_all();
    for (const auto& indices : {interrupted_, std::vector(waiting_.begin(), waiting_.end())})
      outcome_.not_done.insert(outcome_.not_done.end(), indices.begin(), indices.end());
  }

  const SweepPaths& paths_;
  const SweepPlan& plan_;
  const SweepLaunch& launch_;
  std::string frozen_plan_;
  std::size_t jobs_, total_ = 0;
  Clock::time_point begin_;
  double last_report_ = 0, known_peak_mb_ = 0, seconds_sum_ = 0;
  std::size_t seconds_count_ = 0;
  std::deque<std::size_t> waiting_;
  std::set<std::string> open_;         // ids of runs that may still be done
  std::map<std::string, int> killed_;  // for memory, by id
  SweepTurns turns_;
  std::list<Running> running_;
  SweepOutcome outcome_;
  bool is_stopping_ = false, has_warned_of_memory_ = false;
  std::vector<std::size_t> interrupted_;
  Clock::time_point next_try_;
  std::size_t running_before_ = 0;
};

}  // namespace

int sweep_jobs(const SweepPlan& plan, const SweepLaunch& launch) {
  if (launch.jobs > 0) return launch.jobs;
  return std::max(1, launch.threads / std::max(1, plan.threads));
}

int sweep_threads(const SweepPlan& plan, const SweepLaunch& launch) {
  if (plan.threads > 0) return plan.threads;
  return std::max(1, launch.threads / sweep_jobs(plan, launch));
}

SweepOutcome run_sweep_locally(const SweepPaths& paths, const SweepPlan& plan, const SweepLaunch& launch) {
  return Launcher(paths, plan, launch).run();
}

}  // namespace hsi4d
