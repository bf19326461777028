// libhsi4d_vision.so: the only file that includes OpenCV. It links nothing of this project.
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <opencv2/video/tracking.hpp>
#include <string>

#include "pipelines/follow/vision_library.h"

namespace hsi4d {
namespace {

constexpr int kGrabRounds = 8;

/// OpenCV's view of a plane.
cv::Mat plane(Image& image, int c = 0) {
  return {image.height(), image.width(), CV_32F, image.row(c, 0),
          static_cast<std::size_t>(image.row_stride()) * sizeof(float)};
}
cv::Mat plane(const Image& image, int c = 0) { return plane(const_cast<Image&>(image), c); }

cv::Mat bytes(const cv::Mat& plane) {
  cv::Mat result;
  plane.convertTo(result, CV_8U, 255);
  return result;
}

/// What OpenCV throws, in words; on one thread, from the same random numbers each time.
template <class Work>
std::string run(Work work) {
  try {
    cv::setNumThreads(1);
    cv::setRNGSeed(0);
    work();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

std::string find_flow(const Image& from, const Image& to, Image& flow) {
  return run([&] {
    cv::Mat both;
    cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM)->calc(bytes(plane(from)), bytes(plane(to)), both);
    std::array<cv::Mat, 2> planes = {plane(flow, 0), plane(flow, 1)};
    cv::split(both, planes.data());
  });
}

std::string cut(const Image& odds, const Image& links, Image& labels) {
  constexpr std::array<std::array<int, 2>, kCutLinks> kSteps = {{{1, 0}, {0, 1}, {1, 1}, {-1, 1}}};  // x, y
  return run([&] {
    const int width = odds.width(), height = odds.height();
    cv::detail::GCGraph<double> graph(static_cast<unsigned>(width * height),
                                      static_cast<unsigned>(2 * kCutLinks * width * height));
    for (int i = 0; i < width * height; ++i) graph.addVtx();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double value = odds(0, y, x);
        graph.addTermWeights(y * width + x, value > 0 ? value : 0, value > 0 ? 0 : -value);
        for (int k = 0; k < kCutLinks; ++k) {
          const int u = x + kSteps[k][0], v = y + kSteps[k][1];
          const double link = links(k, y, x);
          if (u >= 0 && u < width && v < height && link > 0) graph.addEdges(y * width + x, v * width + u, link, link);
        }
      }
    }
    graph.maxFlow();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) labels(0, y, x) = graph.inSourceSegment(y * width + x) ? 1.0F : 0.0F;
    }
  });
}

std::string find_distances(const Image& mask, Image& distances) {
  return run([&] {
    cv::Mat result = plane(distances);
    cv::distanceTransform(plane(mask) <= 0.5, result, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  });
}

std::string grab(const Image& image, Image& labels) {
  return run([&] {
    std::array<cv::Mat, 3> planes = {bytes(plane(image, 2)), bytes(plane(image, 1)), bytes(plane(image, 0))};
    cv::Mat colors, mask(labels.height(), labels.width(), CV_8U), background, object;
    cv::merge(planes.data(), 3, colors);
    for (int y = 0; y < labels.height(); ++y) {
      for (int x = 0; x < labels.width(); ++x) {
        const float label = labels(0, y, x);
        mask.at<uchar>(y, x) = label <= 0     ? cv::GC_BGD
                               : label >= 1   ? cv::GC_FGD
                               : label < 0.5F ? cv::GC_PR_BGD
                                              : cv::GC_PR_FGD;
      }
    }
    cv::grabCut(colors, mask, {}, background, object, kGrabRounds, cv::GC_INIT_WITH_MASK);
    for (int y = 0; y < labels.height(); ++y) {
      for (int x = 0; x < labels.width(); ++x) {
        const uchar label = mask.at<uchar>(y, x);
        labels(0, y, x) = label == cv::GC_FGD || label == cv::GC_PR_FGD ? 1.0F : 0.0F;
      }
    }
  });
}

constexpr VisionLibrary kLibrary = {find_flow, cut, find_distances, grab};

}  // namespace
}  // namespace hsi4d

extern "C" __attribute__((visibility("default"))) const hsi4d::VisionLibrary* hsi4d_vision_library() {
  return &hsi4d::kLibrary;
}
