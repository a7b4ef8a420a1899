// Time to linearize one measurement: residual and Jacobians in the tangent space, as Ceres asks for
// them.  Each runs over a table of situations, so that nothing stays in the registers.
#include <benchmark/benchmark.h>

#include <memory>
#include <random>
#include <vector>

#include "dqslam/costs/algebraic.h"
#include "dqslam/costs/box.h"
#include "dqslam/costs/odometry.h"
#include "dqslam/costs/tangent.h"
#include "dqslam/geometry/box_derivatives.h"

namespace dqslam {
namespace {

constexpr int kSituations = 1000;
constexpr double kDepth = 6;

Camera MakeCamera() {
  Camera camera;
  camera.fx = camera.fy = 1500;
  camera.cx = 640;
  camera.cy = 512;
  camera.width = 1280;
  camera.height = 1024;
  camera.robot_from_camera << 0.1, 0.05, 0.4, -M_SQRT1_2, 0, 0, M_SQRT1_2;  // looks left
  return camera;
}

/// Poses, what they measure, and an ellipsoid in front of each.
template <typename Pose>
struct Situations {
  Situations() {
    std::mt19937 generator(1);
    const auto draw = [&](double sigma) {
      return std::normal_distribution<double>(0, sigma)(generator);
    };
    const Mount mount(camera);
    for (int i = 0; i < kSituations; ++i) {
      Eigen::Matrix<double, Pose::kTangentSize, 1> tangent, step;
      for (double& value : tangent) value = draw(1);
      for (double& value : step) value = draw(0.1);
      Pose::FromTangent(tangent.data(), poses.emplace_back().data());
      Pose::FromTangent(step.data(), steps.emplace_back().data());
      const CameraInWorld<double> view = LocateCamera<Pose>(poses.back().data(), mount);
      Vector9d e;
      e.head<3>() = view.position + view.camera_from_world.transpose() *
                                        Eigen::Vector3d(draw(0.5), draw(0.5), kDepth);
      for (int k = 3; k < 9; ++k) e[k] = k < 6 ? std::log(0.3) + draw(0.3) : draw(0.1);
      Eigen::Vector4d box;
      ProjectToBox(ToCamera(view, EllipsoidModel::Unpack(e.data())), camera, &box);
      landmarks.push_back(e);
      boxes.push_back(box + Eigen::Vector4d(draw(3), draw(3), draw(3), draw(3)));
    }
  }

  Camera camera = MakeCamera();
  std::vector<Eigen::Matrix<double, Pose::kSize, 1>> poses, steps;
  std::vector<Vector9d> landmarks;
  std::vector<Eigen::Vector4d> boxes;
};

/// Evaluates cost i at the blocks that `blocks_of(i)` points to, round and round.
template <typename BlocksOf>
void Linearize(benchmark::State& state,
               const std::vector<std::unique_ptr<ceres::CostFunction>>& costs,
               const BlocksOf& blocks_of) {
  double residual[6], first[6 * 9], second[6 * 9];
  double* jacobians[] = {first, second};
  size_t i = 0;
  for (auto _ : state) {
    const auto blocks = blocks_of(i);
    costs[i]->Evaluate(blocks.data(), residual, jacobians);
    benchmark::DoNotOptimize(first);
    benchmark::DoNotOptimize(second);
    benchmark::ClobberMemory();
    if (++i == costs.size()) i = 0;
  }
}

template <typename Pose, typename MakeCost>
void LineariseBoxes(benchmark::State& state, const MakeCost& make_cost) {
  const Situations<Pose> situations;
  std::vector<std::unique_ptr<ceres::CostFunction>> costs;
  for (const Eigen::Vector4d& box : situations.boxes) {
    costs.emplace_back(make_cost(situations.camera, box));
  }
  Linearize(state, costs, [&](size_t i) {
    return std::array<const double*, 2>{situations.poses[i].data(), situations.landmarks[i].data()};
  });
}

const Eigen::Matrix4d kWeight = Eigen::Matrix4d::Identity();
const EdgeFlags kTwoSided = EdgeFlags::Constant(false);

template <typename Cost>
ceres::CostFunction* MakeBox(const Camera& camera, const Eigen::Vector4d& box) {
  return Cost::Create(camera, Mount(camera), box, kWeight, kTwoSided);
}

template <typename Cost>
ceres::CostFunction* MakeTangent(const Camera& camera, const Eigen::Vector4d& box) {
  return Cost::Create(camera, Mount(camera), box, kWeight, kDepth, kTwoSided);
}

template <typename Pose>
void BoxAutoDiff(benchmark::State& state) {
  LineariseBoxes<Pose>(state, MakeBox<BoxCost<Pose, EllipsoidModel>>);
}

template <typename Pose>
void TangentAutoDiff(benchmark::State& state) {
  LineariseBoxes<Pose>(state, MakeTangent<TangentCost<Pose, EllipsoidModel>>);
}

template <typename Pose>
void AlgebraicAutoDiff(benchmark::State& state) {
  LineariseBoxes<Pose>(state, [](const Camera& camera, const Eigen::Vector4d& box) {
    return AlgebraicCost<Pose, EllipsoidModel>::Create(
        Mount(camera), BoxLines(camera, box), kWeight, true);
  });
}

/// The derivatives of edges.h with all that leads to them, whitened;
/// `differentiate(camera, surface, box, &error, &edges)`.
template <typename Pose, typename Differentiate>
void LineariseByHand(benchmark::State& state, const Differentiate& differentiate) {
  const Situations<Pose> situations;
  const Mount mount(situations.camera);
  size_t i = 0;
  for (auto _ : state) {
    const Station station = Station::At<Pose>(situations.poses[i].data(), mount);
    const Unpacked<EllipsoidModel> landmark(situations.landmarks[i].data());
    const Surface<double> surface = ToCamera(station.camera, landmark.surface);
    Eigen::Vector4d error;
    EdgeDerivatives edges;
    differentiate(situations.camera, surface, situations.boxes[i], &error, &edges);
    Eigen::Matrix<double, kBoxSize, Pose::kTangentSize> by_pose;
    Eigen::Matrix<double, kBoxSize, kLandmarkSize> by_landmark;
    ByPoseAndLandmark<Pose>(edges, station, mount, landmark, &by_pose, &by_landmark);
    error = kWeight * error;
    by_pose = kWeight * by_pose;
    by_landmark = kWeight * by_landmark;
    benchmark::DoNotOptimize(error);
    benchmark::DoNotOptimize(by_pose);
    benchmark::DoNotOptimize(by_landmark);
    benchmark::ClobberMemory();
    if (++i == situations.boxes.size()) i = 0;
  }
}

template <typename Pose>
void BoxByHand(benchmark::State& state) {
  LineariseByHand<Pose>(state,
                        [](auto& camera, auto& surface, auto& box, auto* error, auto* edges) {
                          DifferentiateBox(surface, camera, error, edges);
                          *error -= box;
                        });
}

template <typename Pose>
void TangentByHand(benchmark::State& state) {
  LineariseByHand<Pose>(state,
                        [](auto& camera, auto& surface, auto& box, auto* error, auto* edges) {
                          DifferentiateTangents(surface, camera, box, kDepth, error, edges);
                        });
}

template <typename Pose>
void OdometryAutoDiff(benchmark::State& state) {
  const Situations<Pose> situations;
  using Square = Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>;
  std::vector<std::unique_ptr<ceres::CostFunction>> costs;
  for (const auto& step : situations.steps) {
    costs.emplace_back(OdometryCost<Pose>::Create(step, Square(Square::Identity())));
  }
  Linearize(state, costs, [&](size_t i) {
    return std::array<const double*, 2>{situations.poses[i].data(),
                                        situations.poses[(i + 1) % kSituations].data()};
  });
}

BENCHMARK(BoxByHand<Se2>);
BENCHMARK(BoxByHand<Se3>);
BENCHMARK(TangentByHand<Se2>);
BENCHMARK(TangentByHand<Se3>);
BENCHMARK(AlgebraicAutoDiff<Se2>);
BENCHMARK(AlgebraicAutoDiff<Se3>);
BENCHMARK(BoxAutoDiff<Se2>);
BENCHMARK(BoxAutoDiff<Se3>);
BENCHMARK(TangentAutoDiff<Se2>);
BENCHMARK(TangentAutoDiff<Se3>);
BENCHMARK(OdometryAutoDiff<Se2>);
BENCHMARK(OdometryAutoDiff<Se3>);

}  // namespace
}  // namespace dqslam

BENCHMARK_MAIN();
