#include "bench/topics.h"

#include <algorithm>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/text.h"

namespace hsi4d::cli {
namespace {

std::string capitalized(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

/// "a", "a and b", "a, b and c".
std::string listed(std::vector<std::string> words) {
  if (words.size() < 2) return joined(words);
  const std::string last = words.back();
  words.pop_back();
  return joined(words) + " and " + last;
}

std::vector<std::string> topics_of(const std::vector<BenchMeaning>& meanings) {
  std::vector<std::string> topics;
  for (const std::string& topic : bench_topic_names()) {
    const auto has_it = [&topic](const BenchMeaning& meaning) {
      return std::find(meaning.topics.begin(), meaning.topics.end(), topic) != meaning.topics.end();
    };
    if (std::any_of(meanings.begin(), meanings.end(), has_it)) topics.push_back(topic);
  }
  return topics;
}

/// What the page of all topics says of an option.
std::string text_for_all(const std::vector<BenchMeaning>& meanings) {
  std::string text;
  for (const BenchMeaning& meaning : meanings) {
    const bool is_of_all = meaning.topics.size() == bench_topics().size();
    text += (text.empty() ? "" : "; ") + (is_of_all ? "" : "of " + listed(meaning.topics) + ": ") + meaning.text;
  }
  return capitalized(text);
}

}  // namespace

const std::vector<BenchTopic>& bench_topics() {
  static const std::vector<BenchTopic> topics = {
      {"rasterize", "Measure every step of the renderer, forward and backward"},
      {"skinning", "Measure the body: skinning and its gradient, of vertices and of Gaussians"},
      {"color_net", "Measure the color net, forward and backward"},
      {"tape", "Measure what a node of the tape costs, and lambda losses against their values alone"},
      {"pixel_filter", "Measure what the renderer's low-pass does to silhouettes"},
      {"stages", "Measure a run, operator by operator"},
      {"scaling", "Measure an iteration against the size of what is reconstructed"},
      {"pareto", "Measure run time against error, setting by setting, and what an error comes to in a reconstruction"}};
  return topics;
}

std::vector<std::string> bench_topic_names() {
  std::vector<std::string> names;
  for (const BenchTopic& topic : bench_topics()) names.push_back(topic.name);
  return names;
}

std::vector<std::string> kernel_topics() { return {"rasterize", "skinning", "color_net", "tape"}; }

void BenchTopicOptions::add(CLI::Option* option, std::vector<BenchMeaning> meanings) {
  option->description(text_for_all(meanings));
  entries_.push_back({option, std::move(meanings)});
}

const BenchMeaning* BenchTopicOptions::meaning_for(const Entry& entry, const std::string& topic) {
  const std::vector<std::string> wanted = topic.empty() ? kernel_topics() : std::vector<std::string>{topic};
  for (const BenchMeaning& meaning : entry.meanings) {
    const auto& topics = meaning.topics;
    if (std::find_first_of(topics.begin(), topics.end(), wanted.begin(), wanted.end()) != topics.end()) return &meaning;
  }
  return nullptr;
}

void BenchTopicOptions::refuse_others(const std::string& topic) const {
  std::vector<std::string> own;
  for (const Entry& entry : entries_) {
    if (meaning_for(entry, topic) != nullptr) own.push_back(entry.option->get_name());
  }
  for (const Entry& entry : entries_) {
    if (entry.option->count() == 0 || meaning_for(entry, topic) != nullptr) continue;
    const std::string command = "hsi4d bench" + (topic.empty() ? "" : " " + topic);
    throw UserError(command + ": " + entry.option->get_name() + " is of " + listed(topics_of(entry.meanings)) +
                    " alone; " + (topic.empty() ? "without a topic there are " : "here there are ") + listed(own));
  }
}

void BenchTopicOptions::describe_topic(const std::string& topic, CLI::App& command) const {
  const auto is_it = [&topic](const BenchTopic& known) { return known.name == topic; };
  const auto found = std::find_if(bench_topics().begin(), bench_topics().end(), is_it);
  if (found == bench_topics().end()) return;
  for (const Entry& entry : entries_) {
    const BenchMeaning* const meaning = meaning_for(entry, topic);
    if (meaning == nullptr) {
      entry.option->group("");  // which no help shows
    } else {
      entry.option->description(capitalized(meaning->text));
    }
  }
  command.remove_option(command.get_option("TOPIC"));
  command.name(command.get_name() + " " + topic);
  command.description(found->summary);
}

}  // namespace hsi4d::cli
