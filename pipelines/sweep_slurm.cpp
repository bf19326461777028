#include "pipelines/sweep_slurm.h"

#include <algorithm>
#include <cstdlib>
#include <set>
#include <sstream>

#include "core/check.h"
#include "core/file.h"
#include "core/process.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScriptHead = "#!/bin/sh\n# Written by hsi4d sweep.\n";

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

/// Ids of runs that earlier arrays of this folder have still to compute. Jobs that Slurm does not know any more have
/// ended.
std::set<std::string> queued_runs(const fs::path& folder) {
  std::set<std::string> queued;
  const std::string file = (folder / "jobs.txt").string();
  if (!fs::exists(file)) return queued;
  std::istringstream jobs(read_text_file(file));
  for (std::string job, plan_file; jobs >> job >> plan_file;) {
    std::string told;
    try {
      told = run_process({"squeue", "--noheader", "--array", "--jobs", job, "--format", "%K"});
    } catch (const ProgramNotStartedError&) {
      throw;
    } catch (const UserError& failure) {
      if (std::string(failure.what()).find("Invalid job id") == std::string::npos) throw;
      continue;
    }
    const std::string plan_path = (folder.parent_path() / "plans" / plan_file).string();
    const SweepPlan plan = parse_sweep_plan(read_text_file(plan_path), plan_path);
    std::istringstream indices(told);
    for (std::string index; indices >> index;) {
      const bool is_number = std::all_of(index.begin(), index.end(), [](char c) { return c >= '0' && c <= '9'; });
      if (is_number && std::stoul(index) < plan.runs.size()) queued.insert(plan.runs[std::stoul(index)].id);
    }
  }
  return queued;
}

void check_array_size(const std::vector<std::size_t>& runs) {
  const std::string most = setting_of_slurm("MaxArraySize");
  if (most.empty() || runs.back() < std::strtoul(most.c_str(), nullptr, 10)) return;
  throw UserError("run " + std::to_string(runs.back()) + " is beyond what this Slurm takes in an array (MaxArraySize " +
                  most + "); cut the sweep into several files");
}

/// Submits a script and returns the id of its job.
std::string submit(std::vector<std::string> options, const std::string& script) {
  options.insert(options.begin(), {"sbatch", "--parsable"});
  options.push_back(script);
  const std::string told = trimmed(run_process(options));
  const std::size_t line = told.rfind('\n');  // warnings come before it
  const std::string id = told.substr(line == std::string::npos ? 0 : line + 1);
  return id.substr(0, id.find(';'));  // of several clusters the name follows
}

}  // namespace

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
                                       const std::vector<std::size_t>& runs, int jobs, int threads) {
  const SweepSlurm& slurm = plan.slurm;
  const int at_once = jobs > 0 ? jobs : slurm.at_once;
  std::vector<std::string> options = {
      "--job-name=" + plan.name,
      "--array=" + array_text(runs) + (at_once > 0 ? "%" + std::to_string(at_once) : ""),
      "--output=" + without_patterns(slurm_folder(paths).string()) + "/%A_%a.txt",
      "--open-mode=append",
      "--requeue",
      "--ntasks=1",
      "--cpus-per-task=" + std::to_string(threads),
      "--signal=B:USR1@" + std::to_string(slurm.grace_s)};
  const double memory = slurm.memory_mb > 0 ? slurm.memory_mb : plan.memory_mb;
  if (memory > 0) options.push_back("--mem=" + std::to_string(static_cast<long>(memory)) + "M");
  if (!slurm.time.empty()) options.push_back("--time=" + slurm.time);
  if (!slurm.partition.empty()) options.push_back("--partition=" + slurm.partition);
  options.insert(options.end(), slurm.options.begin(), slurm.options.end());
  return options;
}

SlurmJobs submit_sweep(const SweepPaths& paths, const SweepPlan& plan, const std::string& program, int jobs,
                       int threads) {
  const fs::path folder = slurm_folder(paths);
  const std::set<std::string> queued = queued_runs(folder);
  SlurmJobs submitted;
  for (const std::size_t index : distinct_runs(plan)) {
    if (is_sweep_run_whole(paths, plan.runs[index].id)) continue;
    if (queued.contains(plan.runs[index].id)) {
      ++submitted.queued;
    } else {
      submitted.runs.push_back(index);
    }
  }
  if (submitted.runs.empty()) return submitted;
  check_array_size(submitted.runs);
  const std::string whole = fs::absolute(paths.folder).lexically_normal().string();
  const std::string plan_file = fs::path(paths.frozen_plan(plan)).filename().string();
  const std::string run_script = (folder / "run.sh").string(), results_script = (folder / "results.sh").string();
  write_text_file(run_script, std::string(kScriptHead) + "exec " + quoted(program) + " run-one " +
                                  quoted(whole + "/plans/" + plan_file) + " \"$SLURM_ARRAY_TASK_ID\" --out " +
                                  quoted(whole) + " --threads " + std::to_string(threads) + " --requeue\n");
  write_text_file(results_script,
                  std::string(kScriptHead) + "exec " + quoted(program) + " report " + quoted(whole) + "\n");
  submitted.array = submit(array_options(paths, plan, submitted.runs, jobs, threads), run_script);
  const std::string known = (folder / "jobs.txt").string();
  write_text_file(known, (fs::exists(known) ? read_text_file(known) : "") + submitted.array + " " + plan_file + "\n");
  std::vector<std::string> options = {"--job-name=" + plan.name + "-results",
                                      "--dependency=afterany:" + submitted.array,
                                      "--output=" + without_patterns(folder.string()) + "/results_%j.txt", "--requeue"};
  if (!plan.slurm.partition.empty()) options.push_back("--partition=" + plan.slurm.partition);
  options.insert(options.end(), plan.slurm.options.begin(), plan.slurm.options.end());
  submitted.results = submit(std::move(options), results_script);
  return submitted;
}

void requeue_this_job() {
  const char* const job = std::getenv("SLURM_JOB_ID");
  if (job == nullptr) throw UserError("hsi4d run-one: --requeue is for jobs of Slurm, and this is none");
  run_process({"scontrol", "requeue", job});
}

}  // namespace hsi4d
