#include "pipelines/sweep/slurm.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <sstream>

#include "core/check.h"
#include "core/file.h"
#include "core/process.h"
#include "core/text.h"
#include "optim/checkpoint.h"
#include "pipelines/sweep/halving.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScriptHead = "#!/bin/sh\n# Written by hsi4d sweep.\n";

// Slurm may warn before the program can note it. A shell cannot block a signal, and one that is ignored is lost; env of
// coreutils 8.31 or later blocks it, so that it waits for the program. Elsewhere the program is at least not killed.
constexpr const char* kKeepWarning =
    "trap '' USR1\n"
    "hold='env --block-signal=USR1'\n"
    "$hold true 2>/dev/null || hold=\n";

fs::path slurm_folder(const SweepPaths& paths) { return fs::absolute(paths.folder).lexically_normal() / "slurm"; }

/// A word of a shell command.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// A path in --output, where % begins a pattern.
std::string without_patterns(const std::string& path) {
  std::string out;
  for (const char c : path) out += c == '%' ? std::string("%%") : std::string(1, c);
  return out;
}

std::string trimmed(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \n\r\t"), end = text.find_last_not_of(" \n\r\t");
  return begin == std::string::npos ? "" : text.substr(begin, end + 1 - begin);
}

/// The text behind "NAME = " in what scontrol shows.
std::string setting_of_slurm(const std::string& name) {
  std::istringstream lines(run_process({"scontrol", "show", "config"}));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t equals = line.find('=');
    if (equals != std::string::npos && trimmed(line.substr(0, equals)) == name) return trimmed(line.substr(equals + 1));
  }
  return "";
}

/// What of a sweep is in the queue.
struct QueuedJobs {
  std::set<std::string> runs;    ///< ids of those that arrays have still to compute
  std::set<std::string> arrays;  ///< of these arrays
  bool has_results = false;      ///< the job for the results
};

constexpr const char* kResultsMark = "results";

/// The comment that a job of a sweep's folder has.
std::string job_comment(const fs::path& folder, const std::string& what) {
  return "hsi4d:" + text_hash(folder.string()) + ":" + what;
}

bool is_number(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// What an array computes: runs of a plan of the folder. Its tasks count from one of them, as Slurm has a highest task.
struct ArraySource {
  std::string plan_file;
  std::size_t first = 0;  ///< the run of task 0

  /// "PLAN.json", or "PLAN.json+1000".
  std::string text() const { return first == 0 ? plan_file : plan_file + "+" + std::to_string(first); }
};

ArraySource parse_source(const std::string& text) {
  const std::size_t plus = text.rfind('+');
  if (plus == std::string::npos || !is_number(text.substr(plus + 1))) return {text, 0};
  return {text.substr(0, plus), std::stoul(text.substr(plus + 1))};
}

/// Adds a run of an array, which has its indices from a plan of the folder.
void add_run(const fs::path& folder, const ArraySource& source, const std::string& task, QueuedJobs& queued,
             std::map<std::string, SweepPlan>& plans) {
  if (!is_number(task)) return;
  const std::string& plan_file = source.plan_file;
  auto plan = plans.find(plan_file);
  if (plan == plans.end()) {
    const std::string path = (folder.parent_path() / "plans" / plan_file).string();
    plan = plans.emplace(plan_file, parse_sweep_plan(read_text_file(path), path)).first;
  }
  const std::size_t run = source.first + std::stoul(task);
  if (run < plan->second.runs.size()) queued.runs.insert(plan->second.runs[run].id);
}

/// What squeue tells of a job, a line each; empty for one that Slurm does not know any more: it has ended.
std::string told_of_job(const std::string& job) {
  try {
    return run_process({"squeue", "--noheader", "--array", "--jobs", job, "--format", "%K"});
  } catch (const ProgramNotStartedError&) {
    throw;
  } catch (const UserError& failure) {
    if (std::string(failure.what()).find("Invalid job id") == std::string::npos) throw;
    return "";
  }
}

QueuedJobs queued_jobs(const fs::path& folder) {
  QueuedJobs queued;
  std::map<std::string, SweepPlan> plans;
  const std::string mark = job_comment(folder, "");
  std::istringstream all(run_process({"squeue", "--noheader", "--array", "--me", "--format", "%F %K %k"}));
  for (std::string line; std::getline(all, line);) {
    std::istringstream words(line);
    std::string job, index, comment;
    words >> job >> index >> comment;
    if (!comment.starts_with(mark)) continue;
    const std::string what = comment.substr(mark.size());
    if (what == kResultsMark) {
      queued.has_results = true;
    } else {
      queued.arrays.insert(job);
      add_run(folder, parse_source(what), index, queued, plans);
    }
  }
  const std::string file = (folder / "jobs.txt").string();  // of jobs that were given another comment
  std::istringstream jobs(fs::exists(file) ? read_text_file(file) : "");
  for (std::string job, source; jobs >> job >> source;) {
    if (queued.arrays.contains(job)) continue;
    std::istringstream indices(told_of_job(job));
    for (std::string index; indices >> index;) {
      queued.arrays.insert(job);
      add_run(folder, parse_source(source), index, queued, plans);
    }
  }
  return queued;
}

/// Runs that one array computes.
struct ArrayPart {
  std::vector<std::size_t> runs;
  std::size_t first = 0;  ///< the run of its task 0
};

/// The runs in as few arrays as this Slurm takes them in, whose tasks are below MaxArraySize.
std::vector<ArrayPart> array_parts(const std::vector<std::size_t>& runs) {
  const std::size_t most = std::strtoul(setting_of_slurm("MaxArraySize").c_str(), nullptr, 10);
  if (most == 0 || runs.back() < most) return {{runs, 0}};
  std::vector<ArrayPart> parts;
  for (const std::size_t run : runs) {
    if (parts.empty() || run - parts.back().first >= most) parts.push_back({{}, run});
    parts.back().runs.push_back(run);
  }
  return parts;
}

/// Submits a script and returns the id of its job.
std::string submit(std::vector<std::string> options, const std::string& script) {
  options.insert(options.begin(), {"sbatch", "--parsable"});
  options.push_back(script);
  return job_number(run_process(options));
}

/// The script that a sweep's folder has under a name, written.
std::string script(const SweepPaths& paths, const std::string& name, const std::string& commands) {
  const std::string file = (slurm_folder(paths) / name).string();
  write_text_file(file, kScriptHead + commands + "\n");
  return file;
}

/// ":ID:ID", as --dependency takes it.
std::string job_list(const std::set<std::string>& jobs) {
  std::string text;
  for (const std::string& job : jobs) text += ":" + job;
  return text;
}

/// How often a run has ended without a word: more starts than ends, and nobody computes it.
int times_lost(const SweepPaths& paths, const std::string& id) {
  int lost = 0;
  for (const SweepAttempt& attempt : read_attempts(paths, id)) lost += attempt.event == "start" ? 1 : -1;
  return std::max(0, lost);
}

/// Runs by the rung of successive halving, of which each waits for those below, and how often their memory is doubled.
std::map<std::pair<std::size_t, int>, std::vector<std::size_t>> array_groups(const SweepPaths& paths,
                                                                             const SweepPlan& plan,
                                                                             const std::vector<std::size_t>& runs) {
  std::map<std::pair<std::size_t, int>, std::vector<std::size_t>> groups;
  for (const std::size_t run : runs) {
    const int doubled = std::min(plan.memory_retries, times_lost(paths, plan.runs[run].id));
    groups[{plan.runs[run].rung, doubled}].push_back(run);
  }
  return groups;
}

/// @param after  other arrays that have to be over before
std::string submit_array(const SweepPaths& paths, const SweepPlan& plan, const ArrayPart& part,
                         const std::string& program, int jobs, int threads, const std::set<std::string>& after,
                         int doubled) {
  const std::string whole = slurm_folder(paths).parent_path().string();
  const ArraySource source = {fs::path(paths.frozen_plan(plan)).filename().string(), part.first};
  const std::string first = std::to_string(part.first);
  const std::string index = part.first == 0 ? "$SLURM_ARRAY_TASK_ID" : "$((SLURM_ARRAY_TASK_ID + " + first + "))";
  const std::string commands = std::string(kKeepWarning) + "exec $hold " + quoted(program) + " run-one " +
                               quoted(whole + "/plans/" + source.plan_file) + " \"" + index + "\" --out " +
                               quoted(whole) + " --threads " + std::to_string(threads) + " --requeue";
  std::vector<std::string> options = array_options(paths, plan, part.runs, jobs, threads, part.first, doubled);
  if (!after.empty()) options.push_back("--dependency=afterany" + job_list(after));
  const std::string name = part.first == 0 ? "run.sh" : "run_from_" + first + ".sh";
  const std::string job = submit(std::move(options), script(paths, name, commands));
  const std::string known = (slurm_folder(paths) / "jobs.txt").string();
  write_text_file(known, (fs::exists(known) ? read_text_file(known) : "") + job + " " + source.text() + "\n");
  return job;
}

/// Submits the job that writes the results once these arrays have ended.
std::string submit_results(const SweepPaths& paths, const SweepPlan& plan, const std::set<std::string>& arrays,
                           const std::string& program) {
  const fs::path folder = slurm_folder(paths);
  std::vector<std::string> options = {"--job-name=" + plan.name + "-results",
                                      "--comment=" + job_comment(folder, kResultsMark),
                                      "--dependency=afterany" + job_list(arrays),
                                      "--output=" + without_patterns(folder.string()) + "/results_%j.txt", "--requeue"};
  if (!plan.slurm.partition.empty()) options.push_back("--partition=" + plan.slurm.partition);
  options.insert(options.end(), plan.slurm.options.begin(), plan.slurm.options.end());
  return submit(
      std::move(options),
      script(paths, "results.sh", "exec " + quoted(program) + " report " + quoted(folder.parent_path().string())));
}

/// What a run gets, MB; 0: what the partition gives.
double known_memory_mb(const SweepPlan& plan) {
  return plan.slurm.memory_mb > 0 ? plan.slurm.memory_mb : plan.memory_mb;
}

int most_at_once(const SweepPlan& plan, int jobs) { return jobs > 0 ? jobs : plan.slurm.at_once; }

}  // namespace

std::string job_number(const std::string& told) {
  std::vector<std::string> numbers;
  std::istringstream lines(told);
  for (std::string line; std::getline(lines, line);) {
    const std::string text = trimmed(line), number = text.substr(0, text.find(';'));
    const bool is_number =
        !number.empty() && std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
    const bool has_cluster =
        number.size() == text.size() ||
        (text.size() > number.size() + 1 && text.find_first_of("; \t", number.size() + 1) == std::string::npos);
    if (is_number && has_cluster) numbers.push_back(number);
  }
  if (numbers.size() == 1) return numbers.front();
  throw UserError("sbatch --parsable: printed " + std::string(numbers.empty() ? "no" : "more than one") +
                  " job's number on a line of its own: \"" + with_escapes(trimmed(told)) + "\"");
}

std::string array_text(const std::vector<std::size_t>& indices) {
  std::string text;
  for (std::size_t i = 0; i < indices.size();) {
    std::size_t last = i;
    while (last + 1 < indices.size() && indices[last + 1] == indices[last] + 1) ++last;
    text += (text.empty() ? "" : ",") + std::to_string(indices[i]);
    if (last > i) text += "-" + std::to_string(indices[last]);
    i = last + 1;
  }
  return text;
}

std::vector<std::string> array_options(const SweepPaths& paths, const SweepPlan& plan,
                                       const std::vector<std::size_t>& runs, int jobs, int threads, std::size_t first,
                                       int doubled) {
  const SweepSlurm& slurm = plan.slurm;
  const int at_once = most_at_once(plan, jobs);
  std::vector<std::size_t> tasks = runs;
  for (std::size_t& task : tasks) task -= first;
  const ArraySource source = {fs::path(paths.frozen_plan(plan)).filename().string(), first};
  std::vector<std::string> options = {
      "--job-name=" + plan.name,
      "--comment=" + job_comment(slurm_folder(paths), source.text()),
      "--array=" + array_text(tasks) + (at_once > 0 ? "%" + std::to_string(at_once) : ""),
      "--output=" + without_patterns(slurm_folder(paths).string()) + "/%A_%a.txt",
      "--open-mode=append",
      "--requeue",
      "--ntasks=1",
      "--cpus-per-task=" + std::to_string(threads),
      "--signal=B:USR1@" + std::to_string(slurm.grace_s)};
  const double memory = std::ldexp(known_memory_mb(plan), doubled);
  if (memory > 0) options.push_back("--mem=" + std::to_string(static_cast<long>(std::ceil(memory))) + "M");
  if (!slurm.time.empty()) options.push_back("--time=" + slurm.time);
  if (!slurm.partition.empty()) options.push_back("--partition=" + slurm.partition);
  options.insert(options.end(), slurm.options.begin(), slurm.options.end());
  return options;
}

SlurmJobs submit_sweep(const SweepPaths& paths, const SweepPlan& plan, const std::string& program, int jobs,
                       int threads) {
  if (plan.memory_retries > 0 && known_memory_mb(plan) == 0)
    throw UserError(
        paths.folder.string() +
        ": memory_retries doubles what a run gets, and the sweep names no memory_mb, of its own or of slurm");
  const SweepFolderLock lock(paths);  // nobody else submits
  const fs::path folder = slurm_folder(paths);
  const QueuedJobs queued = queued_jobs(folder);
  SlurmJobs submitted;
  const std::vector<SweepRunState> states = sweep_run_states(paths, plan);
  for (const std::size_t index : distinct_runs(plan)) {
    if (states[index] == SweepRunState::kLeftOut) continue;
    if (is_sweep_run_whole(paths, plan.runs[index].id)) continue;
    if (queued.runs.contains(plan.runs[index].id)) {
      ++submitted.queued;
    } else {
      submitted.runs.push_back(index);
    }
  }
  std::set<std::string> arrays = queued.arrays;
  std::set<std::string> below;
  std::size_t rung = 0;
  for (const auto& [group, runs] : array_groups(paths, plan, submitted.runs)) {
    if (group.first > rung) below = arrays;
    rung = group.first;
    for (const ArrayPart& part : array_parts(runs)) {
      // The most at once are those of an array: with such a bound the next one waits for the one before.
      std::set<std::string> after = below;
      if (most_at_once(plan, jobs) > 0 && !submitted.arrays.empty()) after.insert(submitted.arrays.back());
      submitted.arrays.push_back(submit_array(paths, plan, part, program, jobs, threads, after, group.second));
      arrays.insert(submitted.arrays.back());
    }
  }
  const bool has_results_of_all = queued.has_results && submitted.arrays.empty();
  if (!arrays.empty() && !has_results_of_all) submitted.results = submit_results(paths, plan, arrays, program);
  return submitted;
}

void requeue_this_job() {
  const char* const job = std::getenv("SLURM_JOB_ID");
  const char* const array = std::getenv("SLURM_ARRAY_JOB_ID");
  const char* const task = std::getenv("SLURM_ARRAY_TASK_ID");
  if (job == nullptr) throw UserError("hsi4d run-one: --requeue is for jobs of Slurm, and this is none");
  const bool is_task = array != nullptr && task != nullptr;
  run_process({"scontrol", "requeue", is_task ? std::string(array) + "_" + task : job});
}

}  // namespace hsi4d
