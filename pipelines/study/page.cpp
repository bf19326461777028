#include "pipelines/study/page.h"

#include <algorithm>

#include "core/base64.h"
#include "core/config_value.h"
#include "pipelines/study/assets.h"

namespace hsi4d {

namespace {

/// JSON that can stand in a script element: nothing in it ends that, or begins a comment.
std::string script_json(const ConfigValue& value) {
  std::string text;
  for (const char c : to_json_line(value)) text += c == '<' ? "\\u003c" : std::string(1, c);
  return text;
}

ConfigValue questions_of(const StudyPair& pair) {
  ConfigValue asked = ConfigValue::make_array();
  for (const StudyQuestion& question : kStudyQuestions) {
    if (pair.asks(question)) asked.items.push_back(ConfigValue::make_string(question.id));
  }
  return asked;
}

/// The pairs without what tells A from B.
ConfigValue blinded_pairs(std::vector<StudyPair> pairs) {
  std::sort(pairs.begin(), pairs.end(), [](const StudyPair& x, const StudyPair& y) { return x.id < y.id; });
  ConfigValue array = ConfigValue::make_array();
  for (const StudyPair& pair : pairs) {
    ConfigValue entry = ConfigValue::make_object(), videos = ConfigValue::make_array();
    for (const std::string& video : {std::min(pair.a, pair.b), std::max(pair.a, pair.b)})
      videos.items.push_back(ConfigValue::make_string(video));
    entry.add("id", ConfigValue::make_string(pair.id));
    entry.add("text", ConfigValue::make_string(pair.text));
    entry.add("videos", std::move(videos));
    entry.add("questions", questions_of(pair));
    array.items.push_back(std::move(entry));
  }
  return array;
}

ConfigValue page_data(const StudyKey& key, const StudyEnd& end, const std::map<std::string, Bytes>& videos) {
  ConfigValue data = ConfigValue::make_object(), questions = ConfigValue::make_object(),
              embedded = ConfigValue::make_object();
  for (const StudyQuestion& question : kStudyQuestions)
    questions.add(question.id, ConfigValue::make_string(question.words));
  for (const auto& [name, video] : videos) embedded.add(name, ConfigValue::make_string(base64(video)));
  data.add("study", ConfigValue::make_string(key.study));
  data.add("shown", ConfigValue::make_integer(key.shown_pairs()));
  data.add("collect", ConfigValue::make_string(end.collect));
  data.add("completion", ConfigValue::make_string(end.completion));
  data.add("questions", std::move(questions));
  data.add("pairs", blinded_pairs(key.pairs));
  data.add("embedded", std::move(embedded));
  return data;
}

}  // namespace

std::string study_page(const StudyKey& key, const StudyEnd& end, const std::map<std::string, Bytes>& videos) {
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" "
         "content=\"width=device-width, initial-scale=1\"/>\n<meta name=\"robots\" content=\"noindex\"/>\n"
         "<title>Which video is better?</title>\n<style>" +
         std::string(study_style()) + "</style>\n</head>\n<body>\n" + std::string(study_body()) +
         "<script type=\"application/json\" id=\"study-data\">" + script_json(page_data(key, end, videos)) +
         "</script>\n<script>" + std::string(study_script()) + "</script>\n</body>\n</html>\n";
}

}  // namespace hsi4d
