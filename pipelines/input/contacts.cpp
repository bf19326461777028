#include "pipelines/input/contacts.h"

#include <algorithm>
#include <cmath>

#include "body/pose_layout.h"
#include "core/check.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/suggest.h"
#include "core/text.h"
#include "optim/motion_start.h"

namespace hsi4d {

namespace {

using Kind = ConfigValue::Kind;

constexpr const char* kContactsFormat = "hsi4d contacts";
constexpr double kFarthestContact = 1e6, kLargestContactWeight = 1e6;  // metres
const std::vector<std::string> kContactsFileKeys = {"format", "version", "contacts"};
const std::vector<std::string> kContactKeys = {"frame", "body", "vertex", "object", "point", "scene", "weight"};

void check_contact_keys(const ConfigValue& object, const std::string& pointer, const std::vector<std::string>& known) {
  check_kind(object, Kind::kObject, pointer);
  for (const ConfigMember& member : object.members) {
    if (std::find(known.begin(), known.end(), member.key) == known.end())
      fail_at(member.value, child_pointer(pointer, member.key),
              "is not known; allowed: " + joined(known) + did_you_mean(member.key, known));
  }
}

const ConfigValue& required_member(const ConfigValue& object, const std::string& pointer, const char* key) {
  const ConfigValue* const value = find_member(object, key);
  if (value == nullptr) fail_at(object, pointer, "there is no \"" + std::string(key) + "\"");
  return *value;
}

/// The one member of two that is there.
const ConfigValue& one_member_of(const ConfigValue& object, const std::string& pointer, const char* a, const char* b,
                                 bool& is_first) {
  const ConfigValue *const first = find_member(object, a), *const second = find_member(object, b);
  if ((first == nullptr) == (second == nullptr))
    fail_at(object, pointer,
            (first == nullptr ? "has neither \"" : "has both \"") + std::string(a) +
                (first == nullptr ? "\" nor \"" : "\" and \"") + b + "\"; allowed: one of the two");
  is_first = first != nullptr;
  return is_first ? *first : *second;
}

Vector3<double> contact_place_at(const ConfigValue& value, const std::string& pointer) {
  check_kind(value, Kind::kArray, pointer);
  if (value.items.size() != 3)
    fail_at(value, pointer, "has " + std::to_string(value.items.size()) + " numbers; allowed: [x, y, z], metres");
  Vector3<double> place;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string at = child_pointer(pointer, std::to_string(i));
    const double x = number_of(value.items[i], at);
    if (!(std::abs(x) <= kFarthestContact))
      fail_at(value.items[i], at, value.items[i].text + " is out of range; allowed: -1e6 to 1e6");
    place[static_cast<Index>(i)] = x;
  }
  return place;
}

Index index_below(const ConfigValue& value, const std::string& pointer, Index count) {
  const std::int64_t index = whole_number_of(value, pointer);
  if (index >= count)
    fail_at(value, pointer, value.text + " is out of range; allowed: 0 to " + std::to_string(count - 1));
  return index;
}

/// The joints of a part of the body: one by its name, or those of a hand.
std::vector<Index> contact_joints_at(const ConfigValue& value, const std::string& pointer) {
  check_kind(value, Kind::kString, pointer);
  const std::vector<std::string>& names = smplx_joint_names();
  const auto named = std::find(names.begin(), names.end(), value.text);
  if (named != names.end()) return {named - names.begin()};
  std::vector<Index> joints;
  for (Index j = 0; j < std::ssize(names); ++j) {
    const std::string& name = names[static_cast<std::size_t>(j)];
    if (is_hand_joint(j) && name.substr(0, name.find('_')) + "_hand" == value.text) joints.push_back(j);
  }
  if (!joints.empty()) return joints;
  std::vector<std::string> known = names;
  known.insert(known.end(), {"left_hand", "right_hand"});
  fail_at(value, pointer,
          "there is no part " + json_string(value.text) + "; allowed: joints of SMPL-X, left_hand, right_hand" +
              did_you_mean(value.text, known));
}

Index touched_object_at(const ConfigValue& value, const std::string& pointer, const std::vector<std::string>& objects) {
  check_kind(value, Kind::kString, pointer);
  const auto found = std::find(objects.begin(), objects.end(), value.text);
  if (found == objects.end())
    fail_at(value, pointer,
            "there is no object " + json_string(value.text) +
                "; allowed: " + (objects.empty() ? "\"scene\", as there are no objects" : joined(objects)) +
                did_you_mean(value.text, objects));
  return found - objects.begin();
}

double contact_weight_at(const ConfigValue& value, const std::string& pointer) {
  const double weight = number_of(value, pointer);
  if (!(weight > 0 && weight <= kLargestContactWeight))
    fail_at(value, pointer, value.text + " is out of range; allowed: above 0, up to 1e6");
  return weight;
}

AnnotatedContact contact_at(const ConfigValue& value, const std::string& pointer, const ContactNames& known) {
  check_contact_keys(value, pointer, kContactKeys);
  AnnotatedContact contact;
  contact.frame = index_below(required_member(value, pointer, "frame"), child_pointer(pointer, "frame"), known.frames);
  bool is_part = false, is_of_object = false;
  const ConfigValue& touches = one_member_of(value, pointer, "body", "vertex", is_part);
  if (is_part) {
    contact.joints = contact_joints_at(touches, child_pointer(pointer, "body"));
  } else {
    contact.vertex = whole_number_of(touches, child_pointer(pointer, "vertex"));
  }
  const ConfigValue& touched = one_member_of(value, pointer, "object", "scene", is_of_object);
  const ConfigValue* const point = find_member(value, "point");
  if (is_of_object) {
    contact.object = touched_object_at(touched, child_pointer(pointer, "object"), known.objects);
    if (point != nullptr) contact.place = contact_place_at(*point, child_pointer(pointer, "point"));
  } else {
    contact.place = contact_place_at(touched, child_pointer(pointer, "scene"));
    if (point != nullptr) fail_at(*point, child_pointer(pointer, "point"), "is of an object; \"scene\" is a point");
  }
  if (const ConfigValue* const weight = find_member(value, "weight"))
    contact.weight = contact_weight_at(*weight, child_pointer(pointer, "weight"));
  return contact;
}

}  // namespace

std::vector<AnnotatedContact> decode_contacts(const std::string& text, const std::string& name,
                                              const ContactNames& known) {
  const ConfigValue tree = parse_json_text(text, name);
  check_contact_keys(tree, "", kContactsFileKeys);
  const ConfigValue& format = required_member(tree, "", "format");
  check_kind(format, Kind::kString, "/format");
  if (format.text != kContactsFormat)
    fail_at(format, "/format", json_string(format.text) + " is not known; allowed: " + json_string(kContactsFormat));
  const ConfigValue& version = required_member(tree, "", "version");
  if (number_of(version, "/version") != 1) fail_at(version, "/version", version.text + " is not known; allowed: 1");
  const ConfigValue& list = required_member(tree, "", "contacts");
  check_kind(list, Kind::kArray, "/contacts");
  std::vector<AnnotatedContact> contacts;
  for (std::size_t i = 0; i < list.items.size(); ++i)
    contacts.push_back(contact_at(list.items[i], "/contacts/" + std::to_string(i), known));
  return contacts;
}

std::vector<AnnotatedContact> read_contacts(const std::string& path, const ContactNames& known) {
  return decode_contacts(read_text_file(path), path, known);
}

void check_contacts(const std::vector<AnnotatedContact>& contacts, const BodyModel* body,
                    const SparseWeights& of_gaussians, const std::string& path) {
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const AnnotatedContact& contact = contacts[i];
    const bool is_vertex = contact.joints.empty();
    const std::string where = path + ": /contacts/" + std::to_string(i) + (is_vertex ? "/vertex" : "/body") + ": ";
    if (is_vertex && body == nullptr)
      throw UserError(where +
                      "the avatar is not made on `body`, so that its vertices are not known; allowed: \"body\"");
    if (is_vertex && contact.vertex >= body->vertex_count())
      throw UserError(where + std::to_string(contact.vertex) + " is out of range; allowed: 0 to " +
                      std::to_string(body->vertex_count() - 1));
    if (touching_rows(contact, body != nullptr ? body->weights : of_gaussians).empty())
      throw UserError(where + "no point of the " + (body != nullptr ? "body" : "avatar") + " follows this part most");
  }
}

}  // namespace hsi4d
