// The subcommands `hsi4d sweep` and `hsi4d run-one`: many runs from one file, and one of them.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/background_program.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/file.h"
#include "core/log.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/suggest.h"
#include "core/text.h"
#include "optim/loss_term.h"
#include "pipelines/cli/failure.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/sweep_text.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/sweep/halving.h"
#include "pipelines/sweep/local.h"
#include "pipelines/sweep/run.h"
#include "pipelines/sweep/slurm.h"

namespace hsi4d::cli {

namespace {

struct SweepArguments {
  std::string sweep;  ///< a sweep's file, the plan that a folder holds, or the folder
  std::string out;    ///< empty: runs/NAME, or the folder of the plan
  std::string launcher = "local";
  int jobs = 0;                ///< 0: as many as there are threads for; of Slurm what the sweep says
  std::optional<int> threads;  ///< of all runs together, of Slurm of each; none or 0: one a core
  double memory_mb = 0;        ///< of all runs together; 0: most of what is free
  bool fail_fast = false;
  bool resume = false;
  bool dry_run = false;
  bool quiet = false;
};

struct RunOneArguments {
  std::string sweep;
  std::int64_t index = 0;
  std::string out;
  std::optional<int> threads;
  int parent = 0;        ///< the process that has started this one and with which it ends; 0: none
  bool requeue = false;  ///< after SIGUSR1 the job of Slurm is put into the queue again
};

namespace fs = std::filesystem;

constexpr double kMemoryShare = 0.9;  // of what is free, for all runs together

/// A plan and the folder that it is for.
struct PlacedPlan {
  SweepPlan plan;
  SweepPaths paths;
  bool is_in_folder = false;  ///< it was read from there
};

PlacedPlan read_plan(const std::string& sweep, const std::string& out, const std::vector<LossTerm>& losses) {
  const fs::path file = fs::is_directory(sweep) ? fs::path(sweep) / "sweep.json" : fs::path(sweep);
  if (fs::is_directory(sweep) && !is_sweep_folder(sweep)) throw UserError(sweep + ": is a folder, and holds no sweep");
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, {}, problems);
  PlacedPlan placed;
  if (is_sweep_plan(tree)) {
    placed.paths.folder = sweep_folder_of(file);
    std::error_code error;  // a folder that is not there is another one
    if (!out.empty() && !fs::equivalent(out, placed.paths.folder, error))
      throw UserError("hsi4d sweep: " + file.string() + " is the plan of its own folder; --out names another one");
    placed.plan = parse_sweep_plan(read_text_file(file.string()), file.string());
    placed.is_in_folder = true;
    return placed;
  }
  placed.plan = plan_sweep(file, descriptions_of(losses));
  placed.paths.folder = out.empty() ? fs::path("runs") / placed.plan.name : fs::path(out);
  return placed;
}

/// The rows of the runs as a table; on a terminal without the names of folders, and labels shortened, where they find
/// no place.
std::string runs_table(Table table) {
  constexpr int kRun = 1, kLabel = 1;  // the second once the first is gone
  constexpr std::size_t kLeast = 20;
  const std::optional<int> columns = stdout_columns();
  if (!columns || table_width(table) <= static_cast<std::size_t>(*columns)) return table_text(table);
  table.head.erase(table.head.begin() + kRun);
  std::size_t longest = 0;
  for (auto& row : table.rows) {
    row.erase(row.begin() + kRun);
    longest = std::max(longest, count_characters(row[kLabel].text));
  }
  const std::size_t others = table_width(table) - longest, all = static_cast<std::size_t>(*columns);
  for (auto& row : table.rows) row[kLabel] = shortened(row[kLabel].text, all > others + kLeast ? all - others : kLeast);
  return table_text(table) +
         "\nwithout the names of folders, to be no wider than the terminal: --dry-run | less -S has them\n";
}

/// The runs as a table, with how each stands.
std::string plan_text(const PlacedPlan& placed) {
  const SweepPlan& plan = placed.plan;
  Table table{.head = {"INDEX", "RUN", "", "STATE"}};
  std::set<std::string> datasets;
  const std::vector<SweepRunState> states = sweep_run_states(placed.paths, plan);
  std::size_t done = 0;
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    const SweepRun& run = plan.runs[i];
    const auto same =
        std::find_if(plan.runs.begin(), plan.runs.end(), [&run](const SweepRun& other) { return other.id == run.id; });
    const auto first = static_cast<std::size_t>(same - plan.runs.begin());
    const SweepRunState state = states[i];
    if (first == i && state == SweepRunState::kDone) ++done;
    if (!run.dataset.empty() && !fs::exists(placed.paths.dataset(run.dataset))) datasets.insert(run.dataset);
    table.rows.push_back({i, run.id, sweep_label(run),
                          first == i ? std::string(sweep_run_state_name(state)) : "as " + std::to_string(first)});
  }
  const std::size_t runs = distinct_runs(plan).size();
  std::string text = runs_table(std::move(table)) + "\nsweep " + plan.name + ": " +
                     count_text(std::ssize(plan.runs), "combination") + ", " +
                     count_text(static_cast<std::int64_t>(runs), "run") + ", " + std::to_string(done) + " done";
  const std::size_t left_out = left_out_by_halving(plan);
  if (left_out > 0) text += ", " + std::to_string(left_out) + " left out by halving in the end";
  if (!datasets.empty()) text += "; " + count_text(std::ssize(datasets), "dataset") + " to be generated";
  return text + "; folder " + placed.paths.folder.string() + "\n";
}

/// Warns where results are there that another program has computed or begun.
/// @param runs  their indices
void warn_of_other_programs(const PlacedPlan& placed, const std::vector<std::size_t>& runs) {
  std::size_t others = 0;
  std::string example;
  for (const std::size_t i : runs) {
    const std::vector<SweepAttempt> attempts = read_attempts(placed.paths, placed.plan.runs[i].id);
    const auto other = std::find_if(attempts.begin(), attempts.end(), [](const SweepAttempt& attempt) {
      return attempt.program.hash != this_program().hash;
    });
    if (other == attempts.end()) continue;
    ++others;
    example = other->program.version + " (" + other->program.git + ")";
  }
  if (others == 0) return;
  log_warning(placed.paths.folder.string() + ": " + count_text(static_cast<std::int64_t>(others), "run") +
              (others == 1 ? " was" : " were") + " computed or begun by another build of hsi4d, " + example +
              ", than this one, " + this_program().version + " (" + this_program().git + "); results.csv tells which");
}

std::string failures_text(const SweepPlan& plan, const SweepOutcome& outcome) {
  std::string text;
  for (const SweepFailure& failure : outcome.failures)
    text += "failed: run " + std::to_string(failure.index) + ", " + sweep_label(plan.runs[failure.index]) + ": " +
            failure.message + "\n";
  if (!outcome.not_done.empty())
    text += count_text(std::ssize(outcome.not_done), "run") + " not computed, after the failure\n";
  if (outcome.over_budget > 0)
    text += count_text(static_cast<std::int64_t>(outcome.over_budget), "run") + " not computed, as the sweep's " +
            number_text(plan.hours) + " h are spent; with more, --resume goes on\n";
  return text;
}

/// Puts this job of Slurm into the queue again, and waits for Slurm to end it: not to be taken for one that has ended
/// by itself.
void requeue_and_wait() {
  constexpr int kMostSeconds = 60;
  requeue_this_job();
  for (int i = 0; i < kMostSeconds && !InterruptWatch::requested(); ++i)
    std::this_thread::sleep_for(std::chrono::seconds(1));
}

std::string local_sweep(const SweepArguments& arguments, const PlacedPlan& placed, int& status) {
  const InterruptWatch watch;
  const Observer observer = observer_on_terminal(arguments.quiet);
  const bool is_terminal = stderr_is_terminal();
  const LogSink log = log_to_file(placed.paths.log());
  warn_of_other_programs(placed, distinct_runs(placed.plan));
  SweepLaunch launch;
  launch.program = "/proc/self/exe";  // this very file, also after another build has taken its name
  launch.jobs = arguments.jobs;
  const int threads = run_threads(arguments.threads);
  launch.threads = threads > 0 ? threads : thread_count();
  launch.memory_mb = arguments.memory_mb > 0 ? arguments.memory_mb : kMemoryShare * available_memory_mb();
  launch.fail_fast = arguments.fail_fast;
  launch.stop_requested = observer.stop_requested;
  if (is_terminal) launch.progress = observer.progress;
  launch.tell = [&](const std::string& line) {
    log.write(LogLevel::kInfo, line);
    if (!arguments.quiet) std::fprintf(stderr, "%s%s\n", is_terminal ? "\r\x1b[K" : "", line.c_str());
  };
  SweepOutcome outcome;
  try {
    outcome = run_sweep_locally(placed.paths, placed.plan, launch);
  } catch (const Interrupted& stop) {
    log.write(LogLevel::kInfo, stop.what());
    throw Interrupted(std::string(stop.what()) + "; hsi4d sweep " + placed.paths.folder.string() + " --resume goes on");
  }
  for (const SweepFailure& failure : outcome.failures)
    status = std::max(status, failure.is_our_bug ? kOurBug : kUserMistake);
  try {
    return write_and_show_results(placed.paths) + failures_text(placed.plan, outcome);
  } catch (const std::exception& problem) {  // a full disk, perhaps
    const std::string failures = failures_text(placed.plan, outcome);
    if (failures.empty()) throw;
    throw UserError(failures + problem.what());
  }
}

/// The file of this program, as nodes are to start it.
std::string program_file() {
  const std::string program = fs::read_symlink("/proc/self/exe").string();
  if (!fs::exists(program))
    throw UserError(program + ": the program's file has been replaced since it was started; start it again");
  return program;
}

void refuse_local_options(const SweepArguments& arguments) {
  if (arguments.fail_fast)
    throw UserError("hsi4d sweep: --fail-fast is of the launcher \"local\"; of Slurm, scancel ends what runs");
  if (arguments.memory_mb > 0)
    throw UserError(
        "hsi4d sweep: --memory is of the launcher \"local\"; of Slurm, memory_mb of the sweep's file is "
        "what a run gets");
  if (arguments.quiet)
    throw UserError("hsi4d sweep: --quiet is of the launcher \"local\"; of Slurm, each run has a log of its own");
}

std::string slurm_sweep(const SweepArguments& arguments, const PlacedPlan& placed) {
  warn_of_other_programs(placed, distinct_runs(placed.plan));
  const int asked = run_threads(arguments.threads);
  const int threads = asked > 0 ? asked : std::max(1, placed.plan.threads);
  const SlurmJobs jobs = submit_sweep(placed.paths, placed.plan, program_file(), arguments.jobs, threads);
  const std::string folder = placed.paths.folder.string();
  const std::string queued =
      jobs.queued > 0 ? count_text(static_cast<std::int64_t>(jobs.queued), "run") + " in the queue already\n" : "";
  if (jobs.arrays.empty() && !jobs.results.empty())
    return queued + "submitted the results as job " + jobs.results + "\n";
  if (jobs.arrays.empty()) return queued + "nothing is left to submit; hsi4d report " + folder + " tells the results\n";
  std::string all;
  for (const std::string& array : jobs.arrays) all += array + ",";
  return queued + "submitted " + count_text(std::ssize(jobs.runs), "run") +
         (jobs.arrays.size() == 1 ? " as job " : " as jobs ") + joined(jobs.arrays) + ", the results as job " +
         jobs.results + "; squeue --jobs " + all + jobs.results + " tells how they stand, hsi4d report " + folder +
         " what is there\n";
}

/// The right to compute a run. A launcher does not wait for it, and gets nothing: it has others to start.
std::optional<SweepClaim> claim_of(const RunOneArguments& arguments, const PlacedPlan& placed, std::size_t index,
                                   const Observer& observer) {
  const std::string& id = placed.plan.runs[index].id;
  if (arguments.parent > 0) return SweepClaim::try_claim(placed.paths, id);
  return SweepClaim(placed.paths, id, observer.stop_requested);
}

/// Why a run is not computed that somebody asks for; empty: it is.
std::string reason_against(const RunOneArguments& arguments, const PlacedPlan& placed, std::size_t index) {
  const std::string run = "run " + std::to_string(index) + ", " + sweep_label(placed.plan.runs[index]);
  if (sweep_run_state(placed.paths, placed.plan.runs[index].id) == SweepRunState::kDone) return "";
  if (is_over_budget(placed.paths, placed.plan))
    return run + ": is not started, as the sweep's " + number_text(placed.plan.hours) + " h are spent\n";
  // An array of Slurm begins after those of the rungs below: what is not computed then will not be.
  const auto may_end = [&](std::size_t other) {
    const SweepRunState state = sweep_run_state(placed.paths, placed.plan.runs[other].id);
    if (arguments.requeue) return state != SweepRunState::kDone && is_claimed(placed.paths, placed.plan.runs[other].id);
    return state == SweepRunState::kNew || state == SweepRunState::kStarted;
  };
  const SweepTurn turn = SweepTurns(placed.plan, done_metrics(placed.paths, placed.plan)).turn(index, may_end);
  if (turn == SweepTurn::kLater)
    throw UserError(run + ": runs of the rung below are not done, and tell whether it is computed; hsi4d sweep " +
                    placed.paths.folder.string() + " --resume computes them");
  return turn == SweepTurn::kNever ? run + ": is left out, others of the rung below were better\n" : "";
}

/// Carries out a run that is ours.
std::string claimed_run(const RunOneArguments& arguments, const PlacedPlan& placed, std::size_t index,
                        SweepClaim& claim, const std::vector<LossTerm>& losses, const Observer& observer) {
  const SweepRun& run = placed.plan.runs[index];
  const std::string before = sweep_run_progress(placed.paths, run);
  try {
    const SweepRunResult result =
        run_one(placed.paths, placed.plan, index, claim, losses, run_threads(arguments.threads), observer);
    return result_text(result.summary, placed.paths.run(run.id));
  } catch (const Interrupted& stop) {
    const bool is_requeued = arguments.requeue && TimeLimitWatch::requested() && !InterruptWatch::requested();
    if (!is_requeued) throw Interrupted(std::string(stop.what()) + "; the same command goes on");
    if (sweep_run_progress(placed.paths, run) == before) {
      const std::string problem =
          "the time of the job was over before a frame was finished, and would be again: give the runs more (" +
          std::string(stop.what()) + ")";
      claim.note("failed", problem);
      throw UserError(problem);
    }
    requeue_and_wait();
    throw Interrupted(std::string(stop.what()) + "; the job is in the queue again");
  }
}

/// Carries out a sweep, or submits it. Returns the tables of results, the plan with dry_run.
/// @param status  receives the exit status where runs have failed
std::string sweep_command(const SweepArguments& arguments, const std::vector<LossTerm>& losses, int& status) {
  const std::vector<std::string> launchers = {"local", "slurm"};
  if (std::find(launchers.begin(), launchers.end(), arguments.launcher) == launchers.end())
    throw UserError("hsi4d sweep: --launcher: there is no launcher \"" + arguments.launcher +
                    "\"; known: " + joined(launchers) + did_you_mean(arguments.launcher, launchers));
  if (arguments.launcher == "slurm") refuse_local_options(arguments);
  PlacedPlan placed = read_plan(arguments.sweep, arguments.out, losses);
  check_sweep_folder(placed.paths, arguments.resume || arguments.dry_run);
  if (arguments.dry_run) return plan_text(placed);
  write_sweep_plan(placed.paths, placed.plan, arguments.resume);
  if (arguments.launcher == "slurm") return slurm_sweep(arguments, placed);
  return local_sweep(arguments, placed, status);
}

/// Carries out one run of a sweep. Returns its table of errors.
/// @param status  receives the exit status where another process computes the run and nobody waits for that
std::string run_one_command(const RunOneArguments& arguments, const std::vector<LossTerm>& losses, int& status) {
  if (arguments.parent > 0) end_with_parent(arguments.parent);
  const InterruptWatch watch;
  const TimeLimitWatch time_limit;
  const PlacedPlan placed = read_plan(arguments.sweep, arguments.out, losses);
  const auto count = std::ssize(placed.plan.runs);
  if (arguments.index >= count)
    throw UserError("hsi4d run-one: there is no run " + std::to_string(arguments.index) + " in " + arguments.sweep +
                    "; allowed: 0 to " + std::to_string(count - 1));
  if (!placed.is_in_folder) write_sweep_plan(placed.paths, placed.plan, true);
  Observer observer = observer_on_terminal(false);
  observer.stop_requested = [] { return InterruptWatch::requested() || TimeLimitWatch::requested(); };
  const auto index = static_cast<std::size_t>(arguments.index);
  const std::string reason = arguments.parent == 0 ? reason_against(arguments, placed, index) : "";  // else looked at
  if (!reason.empty()) return reason;
  std::optional<SweepClaim> claim = claim_of(arguments, placed, index, observer);
  if (!claim) {
    status = kElsewhere;
    return "";
  }
  if (arguments.parent == 0) warn_of_other_programs(placed, {index});  // a launcher has told it of all runs
  return claimed_run(arguments, placed, index, *claim, losses, observer);
}

}  // namespace

void add_sweep(CLI::App& app, Program& program) {
  SweepArguments& a = program.options<SweepArguments>();
  CLI::App* command = app.add_subcommand("sweep", "Many runs from one file: ablations, grids, clips, seeds");
  command->add_option("SWEEP", a.sweep, "The sweep's file, or the folder of one that is to go on")->required();
  command->add_option("--out", a.out, "The sweep's folder; default: runs/NAME with the sweep's name")->type_name("DIR");
  command->add_option("--launcher", a.launcher, "local: processes here; slurm: a job array")
      ->type_name("local|slurm")
      ->capture_default_str();
  command->add_option("--jobs", a.jobs, "The most runs at once; default: as many as there are threads for")
      ->check(whole_number(std::numeric_limits<int>::max()))
      ->type_name("N");
  add_threads(*command, a.threads);
  command->add_option("--memory", a.memory_mb, "Memory for all runs together, MB; default: 90 % of what is free")
      ->check(CLI::NonNegativeNumber)
      ->type_name("MB");
  command->add_flag("--fail-fast", a.fail_fast, "Stop at the first run that fails, the others with their state saved");
  command->add_flag("--quiet", a.quiet, "No progress on stderr; the log has it");
  command->add_flag("--resume", a.resume, "Go on with the sweep in the folder; runs that are done stay");
  command->add_flag("--dry-run", a.dry_run, "Check every combination, print the table of runs, write nothing");
  run_when_chosen(*command, program, [&] { return sweep_command(a, program.terms, program.status); });
}

void add_run_one(CLI::App& app, Program& program) {
  RunOneArguments& a = program.options<RunOneArguments>();
  CLI::App* command = app.add_subcommand("run-one", "One run of a sweep, by its index in the table of --dry-run");
  command->add_option("SWEEP", a.sweep, "The sweep's file, or its folder")->required();
  command->add_option("INDEX", a.index, "From 0")->check(whole_number())->required();
  command->add_option("--out", a.out, "The sweep's folder; default: runs/NAME with the sweep's name")->type_name("DIR");
  add_threads(*command, a.threads);
  command->add_option("--parent", a.parent, "End, with the state saved, when this process does")
      ->check(whole_number(std::numeric_limits<int>::max()))
      ->type_name("PROCESS");
  command->add_flag("--requeue", a.requeue, "On SIGUSR1 save the state and put this job of Slurm into the queue again");
  run_when_chosen(*command, program, [&] { return run_one_command(a, program.terms, program.status); });
}

}  // namespace hsi4d::cli
