// A sweep on a cluster: one job array of Slurm over `hsi4d run-one`, and a job for the results that waits for it.
#pragma once

#include <string>
#include <vector>

#include "pipelines/sweep/folder.h"

namespace hsi4d {

/// What has been submitted.
struct SlurmJobs {
  std::vector<std::size_t> runs;    ///< indices that the arrays compute
  std::size_t queued = 0;           ///< runs that an earlier array of this folder has still to compute
  std::vector<std::string> arrays;  ///< ids of those submitted: one, or more of more runs than Slurm takes in one
  std::string results;              ///< id of the job for the results; empty: none
};

/// The job's number in what `sbatch --parsable` prints: the one line that is NUMBER or NUMBER;CLUSTER; others are
/// warnings of the site. Throws UserError with what was printed where there is none, or more.
std::string job_number(const std::string& told);

/// Indices as --array takes them: {0, 1, 2, 5} is "0-2,5".
std::string array_text(const std::vector<std::size_t>& indices);

/// The options of sbatch for the array, without the script.
/// @param jobs     the most runs at once; 0: what the plan says
/// @param threads  of each run
/// @param first    the run that is task 0
/// @param doubled  how often the memory of a run is doubled, after it was killed for it
std::vector<std::string> array_options(const SweepPaths& paths, const SweepPlan& plan,
                                       const std::vector<std::size_t>& runs, int jobs, int threads,
                                       std::size_t first = 0, int doubled = 0);

/// Submits the runs of a plan that are neither done nor in the queue already, and the job for the results where none is
/// in the queue. What is in the queue is told by the comments of its jobs and by jobs.txt, so that nothing is submitted
/// twice after a kill at any moment. More runs than Slurm takes in an array (MaxArraySize) are several, which wait for
/// each other where there is a bound to the runs at once; so are the rungs of successive halving, each of which waits
/// for those below. A run is put into the queue again when its time is up (its state saved before) or its node is lost,
/// and then goes on.
/// @param program  hsi4d, at the place where the nodes have it
/// A run that has ended without a word, killed for memory perhaps, gets twice as much for each time, up to the plan's
/// memory_retries times.
/// Throws UserError with what Slurm says, and where memory is to be doubled and not said.
SlurmJobs submit_sweep(const SweepPaths& paths, const SweepPlan& plan, const std::string& program, int jobs,
                       int threads);

/// Puts the job that this process is into the queue again, of an array this task alone: the number of the job of its
/// last task is the array's own. Throws UserError outside of a job, or with what Slurm says.
void requeue_this_job();

}  // namespace hsi4d
