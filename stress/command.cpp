#include "stress/command.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "core/table.h"
#include "core/text.h"
#include "pipelines/cli/failure.h"
#include "stress/functions.h"
#include "stress/stress.h"

namespace hsi4d::cli {

namespace {

bool is_asked(const StressCase& row, const std::vector<std::string>& asked) {
  const auto names_it = [&row](const std::string& name) {
    return name == row.id || (name.size() == 1 && name[0] == row.id[0]);
  };
  return asked.empty() || std::any_of(asked.begin(), asked.end(), names_it);
}

std::vector<StressCase> asked_cases(const std::vector<std::string>& asked) {
  const std::span<const StressCase> all = stress_cases();
  for (const std::string& name : asked) {
    if (std::any_of(all.begin(), all.end(), [&](const StressCase& row) { return is_asked(row, {name}); })) continue;
    throw UserError("there is no row \"" + name + "\"; allowed: A1 to " + all.back().id +
                    ", or a letter for its group");
  }
  std::vector<StressCase> some;
  std::copy_if(all.begin(), all.end(), std::back_inserter(some),
               [&](const StressCase& row) { return is_asked(row, asked); });
  return some;
}

const char* verdict(const StressResult& result) {
  if (result.row->run == nullptr) return "exempt";
  if (!result.holds()) return "FAILED";
  return result.would_fail() ? "held" : "NO PROOF";  // it passes without its remedy too
}

std::string number(double value) { return std::isfinite(value) ? formatted("%.2g", value) : formatted("%g", value); }

/// A line a figure: measured, allowed, and measured without the remedy.
std::string lines_of(const StressResult& result) {
  const StressCase& row = *result.row;
  std::string text = formatted("%-4s %-8s %s\n", row.id, verdict(result), row.failure);
  if (row.run == nullptr) return text + formatted("     %s\n", row.exempt);
  for (std::size_t i = 0; i < result.with.size(); ++i) {
    const StressFigure& figure = result.with[i];
    const std::string without = i < result.without.size() ? number(result.without[i].measured) : "thrown";
    text += formatted("     %-58s %9s of %9s   without %9s\n", figure.what.c_str(), number(figure.measured).c_str(),
                      number(figure.allowed).c_str(), without.c_str());
  }
  if (*row.tried_on != '\0') text += formatted("     on: %s\n", row.tried_on);
  if (!result.error.empty()) text += formatted("     thrown: %s\n", result.error.c_str());
  if (!result.error_without.empty()) text += formatted("     thrown without: %s\n", result.error_without.c_str());
  return text + formatted("     without: %s\n", row.remedy);
}

nlohmann::ordered_json json_of(const StressResult& result) {
  const auto finite = [](double value) {
    return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(formatted("%g", value));
  };
  nlohmann::ordered_json figures = nlohmann::json::array();
  for (std::size_t i = 0; i < result.with.size(); ++i) {
    nlohmann::ordered_json figure = {{"what", result.with[i].what},
                                     {"measured", finite(result.with[i].measured)},
                                     {"allowed", finite(result.with[i].allowed)}};
    if (i < result.without.size()) figure["without_remedy"] = finite(result.without[i].measured);
    figures.push_back(std::move(figure));
  }
  nlohmann::ordered_json line = {
      {"row", result.row->id},        {"verdict", verdict(result)}, {"failure", result.row->failure},
      {"remedy", result.row->remedy}, {"figures", figures},         {"seconds", result.seconds}};
  if (*result.row->tried_on != '\0') line["tried_on"] = result.row->tried_on;
  if (!result.error.empty()) line["thrown"] = result.error;
  if (!result.error_without.empty()) line["thrown_without_remedy"] = result.error_without;
  if (result.row->run == nullptr) line["exempt"] = result.row->exempt;
  return line;
}

// --- the table at the end --------------------------------------------------------------------------------------------

struct RowClass {
  char letter;
  const char* name;
};
constexpr std::array<RowClass, 10> kClasses = {{{'A', "projection, covariance"},
                                                {'B', "alpha, blending, sorting"},
                                                {'C', "rotations"},
                                                {'D', "skinning, priors, contacts"},
                                                {'E', "losses"},
                                                {'F', "tape, Adam, arithmetic, files"},
                                                {'G', "caches, long ways, what is read"},
                                                {'P', "what is not a number, in every input"},
                                                {'R', "relations that a render keeps"},
                                                {'L', "10,000 steps"}}};

/// What became of some rows.
struct RowCounts {
  Index tried = 0, failed = 0, exempt = 0;
  double seconds = 0;

  void add(const StressResult& result) {
    const bool is_exempt = result.row->run == nullptr;
    tried += is_exempt ? 0 : 1;
    exempt += is_exempt ? 1 : 0;
    failed += !is_exempt && !result.passed() ? 1 : 0;
    seconds += result.seconds;
  }
};

/// A line for each class that has rows, by the first letter of their ids.
std::string class_table(const std::vector<StressResult>& results) {
  Table table{.head = {"class", "tried", "held", "failed", "exempt", "seconds"}, .align = "lr"};
  for (const RowClass& one : kClasses) {
    RowCounts counts;
    for (const StressResult& result : results)
      if (result.row->id[0] == one.letter) counts.add(result);
    if (counts.tried + counts.exempt == 0) continue;
    table.rows.push_back({std::string(1, one.letter) + "  " + one.name, counts.tried, counts.tried - counts.failed,
                          counts.failed, counts.exempt, Cell(counts.seconds, 1)});
  }
  return "\n" + table_text(table);
}

// --- functions -------------------------------------------------------------------------------------------------------

const char* unit_name(ErrorUnit unit) { return unit == ErrorUnit::kUlp ? "ulp" : "ulp of largest"; }

nlohmann::ordered_json json_of(const FunctionErrors& row) {
  return {
      {"function", row.function}, {"precision", row.precision}, {"argument", row.argument},    {"from", row.low},
      {"to", row.high},           {"instruction_set", row.isa}, {"unit", unit_name(row.unit)}, {"points", row.tried},
      {"largest", row.worst},     {"mean", row.mean},           {"largest_at", row.worst_at},  {"bound", row.bound},
      {"holds", row.holds()}};
}

StressOutcome function_table(const StressOptions& options) {
  if (!options.rows.empty()) throw UserError("--functions is a table of its own: --row says nothing to it");
  StressOutcome outcome;
  std::string json;
  Index failed = 0;
  Table table{.head = {"function", "", "range", "set", "points", "largest", "mean", "at", "bound"},
              .align = "llllrrrrrl"};
  for (const FunctionErrors& row : function_errors(options.points)) {
    const std::string range = row.argument + formatted(" in [%.5g, %.5g]", row.low, row.high);
    table.rows.push_back({row.function, row.precision, range, row.isa, row.tried, Cell(row.worst, 2), Cell(row.mean, 3),
                          formatted("%.6g", row.worst_at), formatted("%.3g", row.bound),
                          std::string(unit_name(row.unit)) + (row.holds() ? "" : "  FAILED")});
    json += json_of(row).dump() + "\n";
    failed += row.holds() ? 0 : 1;
  }
  if (!options.json.empty()) write_text_file(options.json, json);
  const auto tried = std::ssize(table.rows);
  outcome.text = table_text(table) + std::to_string(tried) + " rows tried, " + std::to_string(tried - failed) +
                 " within their bounds\n";
  if (failed > 0) outcome.status = kRowsFailed;
  return outcome;
}

}  // namespace

StressOutcome stress_command(const StressOptions& options) {
  if (options.functions) return function_table(options);
  return run_cases(asked_cases(options.rows), options);
}

StressOutcome run_cases(std::span<const StressCase> cases, const StressOptions& options) {
  std::string json;
  StressOutcome outcome;
  Index exempt = 0;
  std::vector<std::string> failed;
  const auto tell = [&](const StressResult& result) {
    outcome.text += lines_of(result);
    json += json_of(result).dump() + "\n";
    if (result.row->run == nullptr) {
      ++exempt;
    } else if (!result.passed()) {
      failed.push_back(result.row->id);
      log_warning(std::string("row ") + result.row->id + ": " + verdict(result));
    }
  };
  const std::vector<StressResult> results = run_stress(cases, tell, options.threads.value_or(0));
  if (!options.json.empty()) write_text_file(options.json, json);
  outcome.text += class_table(results);
  const Index tried = std::ssize(cases) - exempt;
  outcome.text +=
      formatted("%lld rows tried, %lld held, %lld failed%s; %lld exempt\n", static_cast<long long>(tried),
                static_cast<long long>(tried - std::ssize(failed)), static_cast<long long>(std::ssize(failed)),
                failed.empty() ? "" : (" (" + joined(failed) + ")").c_str(), static_cast<long long>(exempt));
  if (!failed.empty()) outcome.status = kRowsFailed;
  return outcome;
}

}  // namespace hsi4d::cli
