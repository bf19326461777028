// The tables of a sweep's results, to be written as Markdown or HTML.
#pragma once

#include <string>
#include <vector>

#include "pipelines/sweep/results.h"

namespace hsi4d {

/// A row a group of runs, a column a metric: mean ± standard deviation over the seeds of every group; the best mean of
/// a column is marked.
/// @param clip  of this clip alone; null: of all
Table mean_table(const SweepResults& results, const std::string* clip = nullptr);

/// Fewest pairs of which an interval says something: signs of fewer agree by chance too often (of six in 2 · 2⁻⁶ = 3
/// %).
inline constexpr std::size_t kFewestPairs = 6;

/// True where the interval of at least kFewestPairs differences does not contain 0, of a metric that has a better side.
bool is_clear(const PairedDifference& paired, const MetricFacts& metric);

/// Differences to what groups are compared with, with their intervals; marked where they are clear. Without rows where
/// nothing is compared.
Table difference_table(const SweepResults& results);

/// What runs are compared with, for people: "whole"; empty: with nothing.
std::string reference_text(const SweepPlan& plan);

/// "24 runs: 22 done, 1 failed, 1 new".
std::string progress_text(const SweepResults& results);

/// Runs that are not done, a line each, with why.
std::string unfinished_text(const SweepResults& results);

/// What the logs of runs warn of, a line each, what most runs do first: "- 12 of 12 runs: the loss ... is off".
std::string warnings_text(const SweepResults& results);

/// A table under its title and caption as Markdown; empty for one without rows or columns.
std::string markdown_section(const Table& table);

/// All results as Markdown.
std::string sweep_markdown(const SweepResults& results);

/// A line a run: what it is, how it stands, who computed it, and every metric in all its digits.
std::string sweep_csv(const SweepResults& results);

}  // namespace hsi4d
