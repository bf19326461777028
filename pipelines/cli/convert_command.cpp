#include "pipelines/cli/convert_command.h"

#include <cmath>
#include <numbers>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/rotation.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/text.h"
#include "splat/files/quantised.h"
#include "splat/files/splat_file.h"
#include "splat/files/transform.h"

namespace hsi4d::cli {
namespace {

const std::string kConvertCommand = "hsi4d convert: ";

Vector3<double> parse_vector(const std::string& text, const std::string& option) {
  if (text.empty()) return Vector3<double>::Zero();
  const std::vector<double> numbers = parse_numbers(text, 3, kConvertCommand + option, "x,y,z");
  return {numbers[0], numbers[1], numbers[2]};
}

Similarity similarity_of(const ConvertOptions& o) {
  if (!o.matrix.empty()) {
    if (o.scale != 1 || !o.rotate.empty() || !o.translate.empty())
      throw UserError(kConvertCommand + "--matrix says everything; leave out --scale, --rotate and --translate");
    const std::vector<double> numbers =
        parse_numbers(o.matrix, 16, kConvertCommand + "--matrix", "of a 4x4 matrix, row by row");
    Matrix4<double> matrix;
    for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = numbers[static_cast<std::size_t>(i)];
    return similarity_from_matrix(matrix, kConvertCommand + "--matrix");
  }
  if (!(o.scale > 0) || !std::isfinite(o.scale))
    throw UserError(kConvertCommand + "--scale: " + short_number(o.scale) +
                    " is no scale; allowed: a finite number above 0");
  const Vector3<double> degrees = parse_vector(o.rotate, "--rotate");
  return {o.scale, so3_exp(Vector3<double>(degrees * (std::numbers::pi / 180))),
          parse_vector(o.translate, "--translate")};
}

/// The rows that --crop and --min-opacity keep.
std::vector<Index> kept_rows(const Gaussians& g, const ConvertOptions& o) {
  Vector3<double> lower = Vector3<double>::Constant(-INFINITY), upper = Vector3<double>::Constant(INFINITY);
  if (!o.crop.empty()) {
    const std::vector<double> box = parse_numbers(o.crop, 6, kConvertCommand + "--crop", "x0,y0,z0,x1,y1,z1");
    lower = {box[0], box[1], box[2]};
    upper = {box[3], box[4], box[5]};
    if ((upper.array() < lower.array()).any())
      throw UserError(kConvertCommand + "--crop: \"" + o.crop +
                      "\" ends before it begins; allowed: the least x, y, z, then the greatest");
  }
  if (!(o.min_opacity >= 0 && o.min_opacity <= 1))
    throw UserError(kConvertCommand + "--min-opacity: " + short_number(o.min_opacity) +
                    " is no opacity; allowed: 0 to 1");
  std::vector<Index> rows;
  for (Index n = 0; n < g.count(); ++n) {
    const Vector3<double> mean = mean_world(g, n);
    const bool inside = (mean.array() >= lower.array()).all() && (mean.array() <= upper.array()).all();
    const double opacity = 1 / (1 + std::exp(-static_cast<double>(g.opacity_logits[static_cast<std::size_t>(n)])));
    if (inside && opacity >= o.min_opacity) rows.push_back(n);
  }
  return rows;
}

SplatWriteOptions write_options(const ConvertOptions& o) {
  SplatWriteOptions options;
  if (file_ending(o.out) != ".spz" && (o.spz_version || !o.spz_sh_bits.empty()))
    throw UserError(kConvertCommand + (o.spz_version ? "--spz-version" : "--spz-sh-bits") +
                    " says how .spz files are written; " + o.out + " is none");
  options.spz.version = o.spz_version.value_or(options.spz.version);
  if (options.spz.version < 2 || options.spz.version > 4)
    throw UserError(kConvertCommand + "--spz-version: " + std::to_string(options.spz.version) +
                    " is not written; allowed: 2, 3, 4");
  if (o.spz_sh_bits.empty()) return options;
  const std::vector<double> bits =
      parse_numbers(o.spz_sh_bits, 2, kConvertCommand + "--spz-sh-bits", "A,B, from 1 to 8");
  for (const double count : bits) {
    if (!(count >= 1 && count <= 8) || count != std::floor(count))
      throw UserError(kConvertCommand + "--spz-sh-bits: \"" + o.spz_sh_bits +
                      "\" are no numbers of bits; allowed: two whole numbers from 1 to 8, for example 5,4");
  }
  options.spz.sh1_bits = static_cast<int>(bits[0]);
  options.spz.sh_rest_bits = static_cast<int>(bits[1]);
  return options;
}

}  // namespace

std::string convert_command(const ConvertOptions& o) {
  if (o.sh_degree < -1 || o.sh_degree > kHighestShDegree)
    throw UserError(kConvertCommand + "--sh-degree: " + std::to_string(o.sh_degree) + " is no degree; allowed: 0 to " +
                    std::to_string(kHighestShDegree));
  const Similarity similarity = similarity_of(o);
  if (!has_splat_ending(o.out)) check_ending(o.out, kConvertCommand + "OUT", written_splat_endings());
  SplatWriteOptions options = write_options(o);
  check_no_input(o.out, kConvertCommand + "OUT", {o.in});
  check_writable(o.out);
  Vector3<double> origin = Vector3<double>::Zero();  // what the transform brings there, so that digits are kept
  if (!similarity.translation.isZero(0)) origin = inverse(similarity).translation;
  const SplatFile file = read_splats_with_warnings(o.in, origin);
  options.spz.antialiased = file.report.antialiased;
  const std::vector<Index> rows = kept_rows(file.gaussians, o);
  const bool all = std::ssize(rows) == file.gaussians.count();
  Gaussians g = transformed(all ? file.gaussians : selected(file.gaussians, rows), similarity);
  if (o.sh_degree >= 0) g = with_sh_degree(g, o.sh_degree);
  const EncodedSplats encoded = encode_splats(o.out, g, options);
  write_file(o.out, encoded.bytes);
  std::string text = o.out + ": " + count_text(g.count(), "Gaussian");
  if (!all) text += " of " + std::to_string(file.gaussians.count());
  text += ", harmonics of degree " + std::to_string(written_sh_degree(o.out, g.sh_degree)) + ", " +
          std::to_string(encoded.bytes.size()) + " bytes\n";
  if (!encoded.losses.empty()) text += "  not held by the format: " + counts_text(encoded.losses) + "\n";
  if (file.report.antialiased && file_ending(o.out) != ".spz")
    text +=
        "  not held by the format: trained with antialiasing; render.antialias=true draws them as they were trained\n";
  return text;
}

void add_convert(CLI::App& app, Program& program) {
  ConvertOptions& o = program.options<ConvertOptions>();
  CLI::App& command = *app.add_subcommand("convert", "Convert Gaussians between formats: " + joined(splat_endings()));
  command.add_option("IN", o.in, "Gaussians: " + splat_formats_text(" or ", " or "))->required();
  command.add_option("OUT", o.out, "Where to; the ending says how: " + joined(written_splat_endings(), " or "))
      ->required();
  command.add_option("--scale", o.scale, "Multiply lengths, about the origin, first")->type_name("S");
  command.add_option("--rotate", o.rotate, "Turn about the origin, harmonics too: axis times angle in degrees")
      ->type_name("x,y,z");
  command.add_option("--translate", o.translate, "Move, last; metres")->type_name("x,y,z");
  command.add_option("--matrix", o.matrix, "Instead of the three: a 4x4 matrix row by row, 16 numbers apart by commas")
      ->type_name("M");
  command.add_option("--crop", o.crop, "Keep the Gaussians whose means are in this box of IN's coordinates")
      ->type_name("x0,y0,z0,x1,y1,z1");
  command.add_option("--min-opacity", o.min_opacity, "Leave out fainter Gaussians")->type_name("O");
  command.add_option("--sh-degree", o.sh_degree, "Degree of the harmonics, 0 to 3")->type_name("N");
  command.add_option("--spz-version", o.spz_version, "Version of .spz to write: 2, 3 or 4; 3 without")->type_name("N");
  command.add_option("--spz-sh-bits", o.spz_sh_bits, "Bits of harmonics in .spz, degree 1 and above; 8,8 without")
      ->type_name("A,B");
  run_when_chosen(command, program, [&] { return convert_command(o); });
}

}  // namespace hsi4d::cli
