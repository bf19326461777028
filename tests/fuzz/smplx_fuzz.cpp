// Files of SMPL-X body models, and what is made of them. Beside whole archives, whose checksums stop most mutations,
// there are lists of arrays without any, of which an archive is made here.
#include <array>

#include "body/smplx_body.h"
#include "core/npy.h"
#include "tests/fuzz/fuzz.h"
#include "tests/zip_archive.h"

namespace hsi4d::fuzz {

namespace {

constexpr std::array<const char*, 13> kNames = {
    "v_template", "f",           "kintree_table", "weights",           "shapedirs",   "J_regressor", "posedirs",
    "J_template", "J_shapedirs", "hands_meanl",   "hands_componentsl", "hands_meanr", "joint2num"};

std::vector<test::ZipMember> small_body(bool whole) {
  std::vector<test::ZipMember> members;
  const auto add = [&]<class T>(std::size_t name, std::initializer_list<int64_t> shape, const std::vector<T>& numbers) {
    members.push_back(
        {std::string(kNames[name]) + ".npy", encode_npy<T>(std::span(shape.begin(), shape.size()), numbers)});
  };
  const auto add_sixteenths = [&](std::size_t name, std::initializer_list<int64_t> shape) {
    int64_t count = 1;
    for (const int64_t n : shape) count *= n;
    add(name, shape, std::vector<float>(static_cast<std::size_t>(count), 0.0625F));
  };
  add(0, {1, 3}, std::vector<float>{0.5F, 1, 2});
  add(1, {1, 3}, std::vector<std::uint32_t>{0, 0, 0});
  std::vector<std::int64_t> tree(smplx_parents().begin(), smplx_parents().end());
  for (std::int64_t j = 0; j < 55; ++j) tree.push_back(j);
  add(2, {2, 55}, tree);
  std::vector<float> weights(55, 0.0F);
  weights[3] = 1;
  add(3, {1, 55}, weights);
  add_sixteenths(4, {1, 3, whole ? 20 : 11});
  if (whole) {
    add_sixteenths(5, {55, 1});
    add_sixteenths(6, {1, 3, 486});
    add_sixteenths(9, {45});
    add_sixteenths(10, {2, 45});
  } else {
    add_sixteenths(7, {55, 3});
    add_sixteenths(8, {55, 3, 2});
    members.push_back({"joint2num.npy", test::pickled_npy()});
  }
  return members;
}

/// Number of a name, two bytes of length, content: again and again.
Bytes list_of(const std::vector<test::ZipMember>& members) {
  Bytes list = {'L'};
  for (const test::ZipMember& member : members) {
    std::size_t name = 0;
    while (kNames[name] + std::string(".npy") != member.name) ++name;
    test::put(list, name, 1);
    test::put(list, member.content.size(), 2);
    list.insert(list.end(), member.content.begin(), member.content.end());
  }
  return list;
}

Bytes archive_of_list(std::span<const uint8_t> list) {
  std::vector<test::ZipMember> members;
  for (std::size_t at = 1; at + 3 <= list.size();) {
    const std::size_t length = list[at + 1] + 256U * list[at + 2];
    const auto content = list.subspan(at + 3, std::min(length, list.size() - at - 3));
    members.push_back({kNames[list[at] % kNames.size()] + std::string(".npy"), Bytes(content.begin(), content.end())});
    at += 3 + length;
  }
  return test::archive_of(members, false);
}

}  // namespace

std::vector<Bytes> corpus() {
  return {list_of(small_body(true)), list_of(small_body(false)), test::archive_of(small_body(false), false)};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const bool is_list = !file.empty() && file[0] == 'L';
    const Bytes archive = is_list ? archive_of_list(file) : Bytes(file.begin(), file.end());
    const SmplxModel model = decode_smplx(archive, "fuzz.npz", {.betas = 1, .expressions = 1});
    is_read([&] { rest_body(model); });  // that of one vertex has no surface
    SmplxBody<float> body(model);
  });
}

}  // namespace hsi4d::fuzz
