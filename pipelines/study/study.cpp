#include "pipelines/study/study.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <regex>

#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/progress.h"
#include "core/text.h"
#include "core/video.h"
#include "optim/checkpoint.h"
#include "pipelines/evaluate/tracks.h"
#include "pipelines/record/folder.h"
#include "pipelines/study/page.h"
#include "pipelines/study/pairs.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr Index kPreviewPanels = 4;  // of a run's preview.mp4: video, reconstruction, both, another side
constexpr int kResultPanel = 1;
constexpr double kUsualRate = 10;  // of a preview that does not say its own
constexpr int kStudyQuality = 14;  // of x264: finer than a preview's, which is encoded a second time here

// ---- What is shown of a run ----

/// The frames that people see, read one by one.
class ShownFrames {
 public:
  explicit ShownFrames(const fs::path& run)
      : run_{run}, preview_(run_.preview()), is_run_(is_run_folder(run.string())) {
    has_renders_ = is_run_ && has_all_renders();
    if (has_renders_) return;
    const Image first = preview_.read(0);
    if (is_run_ && first.width() % kPreviewPanels != 0)
      throw DataError(preview_.path() + ": is " + std::to_string(first.width()) + " pixels wide, which is no row of " +
                      std::to_string(kPreviewPanels) + " images as hsi4d run writes it");
  }

  Index count() const { return preview_.frames(); }
  /// Whether they are images without loss, and not frames of a video that was compressed.
  bool are_images() const { return has_renders_; }
  double frame_rate() const { return preview_.frame_rate() > 0 ? preview_.frame_rate() : kUsualRate; }
  const std::string& path() const { return preview_.path(); }

  Image read(Index t) {
    if (has_renders_) return take_channels(read_image(run_.frame_image(static_cast<int>(t), "render")), 0, 3);
    const Image frame = preview_.read(t);
    const auto width = static_cast<int>(frame.width() / kPreviewPanels);
    return is_run_ ? crop(frame, 0, kResultPanel * width, frame.height(), width) : frame;
  }

 private:
  bool has_all_renders() const {
    for (Index t = 0; t < count(); ++t) {
      if (!fs::exists(run_.frame_image(static_cast<int>(t), "render"))) return false;
    }
    return count() > 0;
  }

  RunPaths run_;
  VideoReader preview_;
  bool is_run_ = false, has_renders_ = false;
};

/// How a video looks beside the other: what should be the same of both.
struct VideoForm {
  int width = 0, height = 0;
  double seconds = 0, frame_rate = 0;
  bool is_of_images = false;  ///< and not of a video, which is compressed a second time
};

std::string form_text(const VideoForm& form) {
  return std::to_string(form.width) + "x" + std::to_string(form.height) + " pixels, " + rounded(form.seconds, 3) +
         " s at " + rounded(form.frame_rate, 3) + " frames a second";
}

VideoForm encode(const fs::path& run, const fs::path& out, const Observer& observer) {
  ShownFrames frames(run);
  const Image first = frames.read(0);
  VideoForm form{first.width(), first.height(), static_cast<double>(frames.count()) / frames.frame_rate(),
                 frames.frame_rate(), frames.are_images()};
  VideoWriter video(out.string(), form.width, form.height, {.frame_rate = form.frame_rate, .quality = kStudyQuality});
  for (Index t = 0; t < frames.count(); ++t) {
    if (observer.wants_stop()) throw Interrupted("interrupted; nothing is left of the study");
    const Image frame = frames.read(t);
    if (frame.width() != form.width || frame.height() != form.height)
      throw DataError(frames.path() + ": frame " + std::to_string(t) + " is of another size than frame 0");
    video.add(frame);
  }
  video.commit();
  return form;
}

// ---- The study's folder ----

void check_is_new(const StudySettings& settings) {
  std::error_code error;
  if (fs::exists(settings.out, error) && (!fs::is_directory(settings.out, error) || !fs::is_empty(settings.out, error)))
    throw UserError(settings.out.string() + ": is not a new or empty folder");
  const fs::path key = study_key_file(settings.out);
  if (fs::exists(key, error)) throw UserError(key.string() + ": is the key of another study; answers to that need it");
}

/// A study's folder in the making, removed with everything in it, and with its key, unless it is kept.
class NewFolder {
 public:
  explicit NewFolder(const fs::path& path) : path_(path), was_there_(fs::exists(path)) {
    std::error_code error;
    fs::create_directories(path_ / "videos", error);
    if (error) throw UserError(path_.string() + ": the folder cannot be made: " + error.message());
  }
  ~NewFolder() {
    if (is_kept_) return;
    std::error_code ignored;
    fs::remove(study_key_file(path_), ignored);
    if (!was_there_) {
      fs::remove_all(path_, ignored);
      return;
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(path_, ignored)) fs::remove_all(entry, ignored);
  }
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;

  fs::path video(const std::string& name) const { return path_ / "videos" / (name + ".mp4"); }
  fs::path videos() const { return path_ / "videos"; }
  void keep() { is_kept_ = true; }

 private:
  fs::path path_;
  bool was_there_, is_kept_ = false;
};

/// When every file of a video says that it was made: 2020.
const fs::file_time_type kTimeOfVideos =
    std::chrono::file_clock::from_sys(std::chrono::sys_seconds(std::chrono::sys_days(std::chrono::year(2020) / 1 / 1)));

/// Whether a browser takes it for the address of a server: http(s)://HOST[:PORT][/...].
bool is_web_address(const std::string& text) {
  static const std::regex address("https?://[A-Za-z0-9.-]+(:([0-9]{1,5}))?([/?#][!-~]*)?");
  std::smatch found;
  return std::regex_match(text, found, address) && (!found[2].matched || std::stoi(found[2]) <= 65535);
}

/// Throws UserError for an address or a code that the page could not use.
void check_end(const StudyEnd& end) {
  const auto is_printable = [](const std::string& text) {
    return std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c <= '~'; });
  };
  if (!end.collect.empty() && !is_web_address(end.collect))
    throw UserError("hsi4d study: --collect: " + json_string(end.collect) +
                    " is no address; allowed: https://HOST, http://HOST:PORT/PATH and the like");
  if (!is_printable(end.completion))
    throw UserError("hsi4d study: --completion: " + json_string(end.completion) +
                    " is neither a code nor an address; allowed: characters of ASCII without spaces");
}

/// Sixteen random hexadecimal digits, by the system's generator.
std::string random_digits() {
  std::random_device device;
  std::string digits;
  for (int i = 0; i < 16; ++i) digits += "0123456789abcdef"[device() % 16];
  return digits;
}

/// A name that tells nothing of what it stands for: random, or with a seed the hash of seed and content.
std::string name_of(const StudySettings& settings, const std::string& content) {
  return settings.seed ? text_hash(std::to_string(*settings.seed) + "\n" + content) : random_digits();
}

/// Makes one video of a pair's side, "a" or "b".
std::string add_video(const StudySettings& settings, const fs::path& run, const std::string& place,
                      const NewFolder& folder, VideoForm& form, const Observer& observer) {
  const fs::path unnamed = folder.video("unnamed");
  form = encode(run, unnamed, observer);
  const std::string name = name_of(settings, place + "\n" + read_text_file(unnamed.string()));
  std::error_code error;
  fs::rename(unnamed, folder.video(name), error);
  // All of one time: the older of a pair would else be A's.
  if (!error) fs::last_write_time(folder.video(name), kTimeOfVideos, error);
  if (error) throw UserError(folder.video(name).string() + ": cannot be written: " + error.message());
  return name;
}

bool are_alike(const VideoForm& a, const VideoForm& b) {
  return a.width == b.width && a.height == b.height && a.frame_rate == b.frame_rate && a.seconds == b.seconds;
}

/// The videos of a pair as they came.
struct PairForms {
  std::string name;
  VideoForm a, b;
};

/// What people may choose by that is not the method's.
void tell_forms(const std::vector<PairForms>& pairs, std::vector<std::string>& notes) {
  std::vector<std::string> a_finer, b_finer;
  for (const PairForms& pair : pairs) {
    if (!are_alike(pair.a, pair.b))
      notes.push_back(pair.name + ": the videos differ in form, which may decide the choice: A has " +
                      form_text(pair.a) + ", B " + form_text(pair.b));
    if (pair.a.is_of_images != pair.b.is_of_images) (pair.a.is_of_images ? a_finer : b_finer).push_back(pair.name);
  }
  const auto tell = [&notes](const std::string& finer, const std::string& other, const auto& names) {
    if (names.empty()) return;
    notes.push_back(finer + " is made of images and " + other +
                    " of a video, which is thereby compressed twice and may look worse for that: " + joined(names));
  };
  tell("A", "B", a_finer);
  tell("B", "A", b_finer);
}

StudyPair make_pair(const StudySettings& settings, const StudyRuns& runs, const NewFolder& folder, PairForms& forms,
                    Progress& progress, const Observer& observer) {
  StudyPair pair{name_of(settings, "pair\n" + runs.name), runs.name, runs.text, "", ""};
  forms.name = runs.name;
  pair.a = add_video(settings, runs.a, "a\n" + runs.name, folder, forms.a, observer);
  progress.step();
  pair.b = add_video(settings, runs.b, "b\n" + runs.name, folder, forms.b, observer);
  progress.step();
  return pair;
}

/// The videos of a study, taken out of its folder.
std::map<std::string, Bytes> embedded_videos(const StudyKey& key, const NewFolder& folder) {
  std::map<std::string, Bytes> videos;
  for (const StudyPair& pair : key.pairs) {
    for (const std::string& name : {pair.a, pair.b}) videos[name] = read_file(folder.video(name).string());
  }
  std::error_code ignored;
  fs::remove_all(folder.videos(), ignored);
  return videos;
}

}  // namespace

fs::path study_key_file(const fs::path& folder) {
  fs::path clean = folder.lexically_normal();
  if (clean == "." || *std::prev(clean.end()) == "..") clean = fs::absolute(folder).lexically_normal();
  const fs::path named = clean.has_filename() ? clean : clean.parent_path();  // without a '/' at its end
  return named.string() + "-key.json";
}

Study make_study(const StudySettings& settings, const Observer& observer) {
  check_is_new(settings);
  check_end(settings.end);
  const std::string salt = settings.seed ? "" : random_digits() + random_digits();
  Study study{{"", settings.a, settings.b, salt, settings.pairs_per_person, {}},
              settings.out / "index.html",
              study_key_file(settings.out),
              {}};
  const std::vector<StudyRuns> runs = study_runs(settings.a, settings.b, settings.texts, study.notes);
  NewFolder folder(settings.out);
  {
    Progress progress("study", 2 * std::ssize(runs), observer.progress, observer.progress_interval);
    std::vector<PairForms> forms(runs.size());
    for (std::size_t i = 0; i < runs.size(); ++i)
      study.key.pairs.push_back(make_pair(settings, runs[i], folder, forms[i], progress, observer));
    tell_forms(forms, study.notes);
  }
  study.key.study = study_id(study.key);
  const std::map<std::string, Bytes> videos =
      settings.embed ? embedded_videos(study.key, folder) : std::map<std::string, Bytes>{};
  write_text_file(study.key_file.string(), study_key_json(study.key));
  write_text_file(study.page.string(), study_page(study.key, settings.end, videos));
  folder.keep();
  return study;
}

}  // namespace hsi4d
