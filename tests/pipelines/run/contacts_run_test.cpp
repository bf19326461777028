// A run that has annotated contacts: the body goes to what it is said to touch.
#include <fstream>
#include <map>

#include <catch2/catch.hpp>

#include "pipelines/config/run_notes.h"
#include "tests/support/tiny_run.h"

namespace contacts_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

void write_contacts(const fs::path& dataset, const std::string& contacts) {
  std::ofstream(dataset / "contacts.json")
      << R"({"format": "hsi4d contacts", "version": 1, "contacts": [)" << contacts << "]}";
}

/// The config of the dataset with its contacts, as a loss alone in its stages.
RunConfig config_of(const CopiedDataset& dataset) {
  write_changed(dataset.path / "config.json", dataset.path / "changed.json", [](auto& c) {
    c["data"]["contacts"] = "contacts.json";
    auto& stage = c["stages"]["interaction"];
    stage["iterations"] = 40;
    stage["losses"] = {{"annotated_contact", {{"weight", 1}}}};
    stage["optimize"] = {{"transl", {{"lr", 0.05}, {"lr_final_share", 0.02}}}};
    c["stages"]["all"] = {{"over", "sequence"},
                          {"iterations", 3},
                          {"losses", {{"annotated_contact", {{"weight", 1}}}, {"fit", {{"weight", 1}}}}},
                          {"optimize", {{"transl", {{"lr", 0.001}}}}}};
  });
  return load_run_config(dataset.path / "changed.json", {}, descriptions_of(loss_terms()), ConfigUse::kRun);
}

}  // namespace

TEST_CASE("contacts of some frames pull in these alone, in stages over frames and over the sequence", "[run]") {
  const CopiedDataset dataset;
  write_contacts(dataset.path,
                 R"({"frame": 2, "body": "left_wrist", "scene": [0.5, 0.6, 1.2]},
                    {"frame": 2, "body": "left_hand", "object": "watering_can", "weight": 0.5},
                    {"frame": 3, "vertex": 100, "scene": [0, 0.7, 1.5]})");
  const fs::path run = dataset.folder.path() / "run";
  execute_tiny(config_of(dataset), run.string());
  const std::string log = file_text(run / "log.txt");
  CHECK_THAT(log, Contains("annotated_contact: 2 contacts, on average "));
  CHECK_THAT(log, Contains("annotated_contact: 1 contact, "));
  CHECK_THAT(log, Contains("annotated_contact: 3 contacts, on average "));
  std::map<int, std::pair<double, double>> by_frame;  // before and after
  double over_all = -1;
  for (const nlohmann::json& line : metrics_of(run)) {
    if (line["stage"] == "all" && line["iteration"] == 0) over_all = line["losses"]["annotated_contact"];
    if (line["stage"] != "interaction") continue;
    const double value = line["losses"]["annotated_contact"];
    by_frame.try_emplace(line["frame"], value, value).first->second.second = value;
  }
  CHECK(by_frame[1] == std::pair(0.0, 0.0));
  CHECK(by_frame[2].second < 0.95 * by_frame[2].first);  // two places that one hand cannot both be at
  CHECK(by_frame[3].first > 0.01);
  CHECK(by_frame[3].second < 0.01 * by_frame[3].first);
  const double after = (by_frame[2].second + by_frame[3].second) / 3;  // the mean over frames 1 to 3
  CHECK(over_all <= 1.05 * after);
  CHECK(over_all > 0.3 * after);  // points nearer by now may stand for those of before
}

TEST_CASE("contacts that do not fit the clip end a run before it begins, and others are another run", "[run]") {
  const CopiedDataset dataset;
  const fs::path run = dataset.folder.path() / "run";
  const auto fault = [&](const std::string& contacts) {
    write_contacts(dataset.path, contacts);
    try {
      execute_tiny(config_of(dataset), run.string());
    } catch (const std::exception& problem) {
      CHECK_FALSE(fs::exists(run));
      return std::string(problem.what());
    }
    return std::string();
  };
  CHECK_THAT(fault(R"({"frame": 4, "body": "head", "scene": [0, 0, 0]})"),
             Contains("contacts.json:1: /contacts/0/frame: 4 is out of range; allowed: 0 to 3"));
  CHECK_THAT(fault(R"({"frame": 1, "body": "head", "object": "vase"})"),
             Contains("/contacts/0/object: there is no object \"vase\"; allowed: watering_can"));
  CHECK_THAT(fault(R"({"frame": 1, "vertex": 999999, "scene": [0, 0, 0]})"),
             Contains("contacts.json: /contacts/0/vertex: 999999 is out of range; allowed: 0 to 18711"));
  CHECK(fault(R"({"frame": 1, "body": "head", "scene": [0, 0, 1.8]})").empty());
  fs::remove(run / "status.json");
  write_contacts(dataset.path, R"({"frame": 1, "body": "head", "scene": [0, 0, 1.9]})");
  CHECK_THROWS_WITH(execute_tiny(config_of(dataset), run.string(), 1, true),
                    Contains("contacts.json: is not what the run began with (/data/contacts)"));
}

TEST_CASE("contacts without the loss, and the loss without contacts, are told", "[run]") {
  const CopiedDataset dataset;
  write_contacts(dataset.path, "");
  RunConfig config = config_of(dataset);
  const auto notes = [](const RunConfig& of) {
    std::string text;
    for (const RunNote& note : run_notes(of)) text += note.text + "\n";
    return text;
  };
  CHECK(notes(config).find("contacts") == std::string::npos);
  config.data.contacts.clear();
  CHECK_THAT(notes(config), Contains("stages.interaction: without data.contacts its loss annotated_contact is off"));
  config = config_of(dataset);
  for (auto& [name, stage] : config.stages) stage.losses = tiny_config().stages.back().second.losses;
  CHECK_THAT(notes(config),
             Contains("data.contacts does nothing: no stage has the loss annotated_contact, with a weight above 0"));
}

}  // namespace contacts_run_test
