#include "pipelines/follow/follow.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/progress.h"
#include "core/size_text.h"
#include "core/text.h"
#include "pipelines/config/masks.h"
#include "pipelines/follow/pictures.h"
#include "pipelines/input/clip.h"

namespace hsi4d {

namespace {

constexpr Index kSheetPictures = 24;  // at most
constexpr int kSheetColumns = 6, kSheetSide = 192;
constexpr int kSheetBorder = 3;  // pixels

std::string_view state_name(Followed state) {
  return state == Followed::kSeen ? "seen" : state == Followed::kDoubtful ? "doubtful" : "not found";
}

void check_same_size(const Image& image, const Image& first, const std::string& place) {
  if (image.height() != first.height() || image.width() != first.width())
    throw DataError(place + ": is " + size_text(image) + " pixels, the first frame " + size_text(first));
}

/// Throws DataError where pictures or objects are too small, at the size at which they are looked at.
void check_large_enough(const Image& frame, const std::vector<ObjectToFollow>& objects, int longest_side_px,
                        const std::string& place) {
  const Image image = reduced_to(frame, longest_side_px);
  if (std::min(image.width(), image.height()) < kLeastFollowSide)
    throw DataError(place + ": is " + size_text(frame) + " pixels, and looked at with " + size_text(image) +
                    "; objects are followed where both are at least " + std::to_string(kLeastFollowSide));
  for (const ObjectToFollow& object : objects) {
    if (!shows_something(reduced_to(object.mask, longest_side_px)))
      throw DataError(object.name + ": its mask in the first frame is too small to be followed in pictures of " +
                      size_text(image) + " pixels");
  }
}

// ---- The contact sheet ----

/// Frames beside each other; empty until the first one.
struct ContactSheet {
  Image image;
  Index pictures = 0;
};

/// Lays the masks over a picture, and says by its border what is worst.
void tint(Image& picture, const std::vector<FollowedMask>& masks) {
  Followed worst = Followed::kSeen;
  for (const FollowedMask& one : masks) {
    worst = std::max(worst, one.state);
    const Image mask = resize_area(one.mask, picture.height(), picture.width());
    for (int y = 0; y < picture.height(); ++y) {
      for (int x = 0; x < picture.width(); ++x) {
        const float share = mask(0, y, x) / 2;
        const std::array<float, 3> color = {one.state == Followed::kSeen ? 0.0F : 1.0F, 1, 0};
        for (int c = 0; c < 3; ++c) picture(c, y, x) += share * (color[static_cast<std::size_t>(c)] - picture(c, y, x));
      }
    }
  }
  if (worst == Followed::kSeen) return;
  const std::array<float, 3> color = {1, worst == Followed::kDoubtful ? 1.0F : 0.0F, 0};
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      const int from_border = std::min({x, y, picture.width() - 1 - x, picture.height() - 1 - y});
      for (int c = 0; c < 3 && from_border < kSheetBorder; ++c) picture(c, y, x) = color[static_cast<std::size_t>(c)];
    }
  }
}

void add_to_sheet(ContactSheet& sheet, const Image& frame, const std::vector<FollowedMask>& masks, Index all) {
  Image picture = reduced_to(frame, kSheetSide);
  tint(picture, masks);
  const int height = picture.height(), width = picture.width();
  if (sheet.image.empty()) {
    const int columns = static_cast<int>(std::min<Index>(all, kSheetColumns));
    sheet.image = Image(3, height * static_cast<int>((all + columns - 1) / columns), width * columns);
  }
  const int columns = sheet.image.width() / width, at = static_cast<int>(sheet.pictures++);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < height; ++y)
      std::copy_n(picture.row(c, y), width, sheet.image.row(c, at / columns * height + y) + at % columns * width);
  }
}

// ---- Files ----

ConfigValue scores_value(const std::vector<FollowedTrack>& tracks) {
  ConfigValue all = ConfigValue::make_object();
  for (const FollowedTrack& track : tracks) {
    ConfigValue states = ConfigValue::make_array(), scores = ConfigValue::make_array();
    for (const Followed state : track.states) states.items.push_back(ConfigValue::make_string(state_name(state)));
    for (const double score : track.scores)
      scores.items.push_back(ConfigValue::make_number(std::round(1000 * score) / 1000));
    ConfigValue one = ConfigValue::make_object();
    one.add("states", std::move(states));
    one.add("scores", std::move(scores));
    all.add(track.name, std::move(one));
  }
  return all;
}

std::vector<FollowedMask> given_masks(const std::vector<ObjectToFollow>& objects) {
  std::vector<FollowedMask> masks;
  for (const ObjectToFollow& object : objects) masks.push_back({object.mask, Followed::kSeen, 1});
  return masks;
}

std::vector<Image> images_of(const std::vector<ObjectToFollow>& objects) {
  std::vector<Image> masks;
  for (const ObjectToFollow& object : objects) masks.push_back(object.mask);
  return masks;
}

std::string frames_in(const std::vector<Index>& frames) {
  return (frames.size() == 1 ? "frame " : "frames ") + frame_ranges(frames);
}

}  // namespace

Image read_rgb(const FrameSource& frames, Index frame) {
  Image image = frames.read(frame);
  if (image.channels() == 3) return image;
  if (image.channels() > 3) return take_channels(image, 0, 3);
  Image rgb(3, image.height(), image.width());  // grey
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < image.height(); ++y) std::copy_n(image.row(0, y), image.width(), rgb.row(c, y));
  }
  return rgb;
}

Image human_mask(const std::optional<MaskSource>& human, const FrameSource& frames, Index frame) {
  if (!human) return {};
  const Image mask = human->read(frames, frame);
  if (!mask.empty()) return mask;
  const Image size = frames.read(frame);
  return {1, size.height(), size.width()};
}

std::vector<FollowedTrack> follow_objects(const FrameSource& frames, const std::optional<MaskSource>& human,
                                          const std::vector<ObjectToFollow>& objects, int longest_side_px,
                                          const std::function<std::string(const std::filesystem::path&)>& path_of,
                                          const Observer& observer) {
  std::vector<FollowedTrack> tracks;
  for (const ObjectToFollow& object : objects) tracks.push_back({object.name, {}, {}});
  const Image first = read_rgb(frames, 0);
  check_large_enough(first, objects, longest_side_px, frames.place(0));
  const Index shown = std::min(frames.count(), kSheetPictures);
  ContactSheet sheet;
  std::optional<ObjectFollower> follower;
  Progress progress("following objects", frames.count(), observer.progress, observer.progress_interval);
  for (Index t = 0; t < frames.count(); ++t) {
    if (observer.wants_stop()) throw Interrupted("interrupted while objects were followed; nothing is left of it");
    const Image frame = read_rgb(frames, t), person = human_mask(human, frames, t);
    check_same_size(frame, first, frames.place(t));
    if (human) check_same_size(person, first, human->place(frames, t));
    if (t == 0) follower.emplace(frame, images_of(objects), person, longest_side_px);
    const std::vector<FollowedMask> masks = t == 0 ? given_masks(objects) : follower->next(frame, person);
    const std::filesystem::path file = frames.names()[static_cast<std::size_t>(t)];
    for (std::size_t i = 0; i < masks.size(); ++i) {
      tracks[i].states.push_back(masks[i].state);
      tracks[i].scores.push_back(masks[i].score);
      write_image(path_of(std::filesystem::path(objects[i].name) / file), masks[i].mask);
    }
    if (human) write_image(path_of(std::filesystem::path(kHumanMasks) / file), person);
    if (sheet.pictures * frames.count() <= t * shown) add_to_sheet(sheet, frame, masks, shown);
    progress.step();
  }
  write_image(path_of(kSheetFile), sheet.image);
  write_text_file(path_of("scores.json"), to_json(scores_value(tracks)));
  return tracks;
}

bool is_whole(const FollowedTrack& track) {
  return std::all_of(track.states.begin(), track.states.end(), [](Followed state) { return state == Followed::kSeen; });
}

std::string track_text(const FollowedTrack& track, const FrameSource& frames) {
  std::vector<Index> hidden, doubtful;
  double sum = 0, least = 1;
  Index least_at = 0, seen = 0;
  for (std::size_t t = 0; t < track.states.size(); ++t) {
    const Index number = frames.number(static_cast<Index>(t));
    if (track.states[t] == Followed::kHidden) {
      hidden.push_back(number);
      continue;
    }
    if (track.states[t] == Followed::kDoubtful) doubtful.push_back(number);
    ++seen;
    sum += track.scores[t];
    if (track.scores[t] < least) {
      least = track.scores[t];
      least_at = number;
    }
  }
  std::string text = track.name + ": seen in " + std::to_string(seen) + " of " + std::to_string(track.states.size()) +
                     " frames, score " + rounded(sum / static_cast<double>(std::max<Index>(seen, 1)), 2) +
                     " on average";
  if (least < 1) text += ", least " + rounded(least, 2) + " in frame " + std::to_string(least_at);
  if (!doubtful.empty()) text += "; doubtful in " + frames_in(doubtful);
  if (!hidden.empty()) text += "; not found in " + frames_in(hidden);
  return text;
}

}  // namespace hsi4d
