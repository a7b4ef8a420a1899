#include "dqslam/estimation/realign.h"

#include <algorithm>
#include <cmath>

#include "dqslam/estimation/bend_path.h"
#include "dqslam/estimation/rigid_consensus.h"
#include "dqslam/estimation/start_object.h"
#include "dqslam/geometry/dispatch.h"

namespace dqslam {
namespace {

constexpr int kMostObjects = 12;  // those with the most boxes; all minimal sets of them are tried

// An object that the new poses see.
struct SeenAgain {
  PlacePair places;
  int last_view;  // the last pose before the new ones that has a box of it
  size_t views;
};

template <typename Pose>
class Realignment {
 public:
  static constexpr int k = Pose::kTangentSize;
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Square = Eigen::Matrix<double, k, k>;

  Realignment(const SolveContext& context, int begin, int end, const State& state)
      : context_(context), prepared_(context.prepared), begin_(begin), end_(end), before_(state) {}

  std::optional<State> Run(const std::vector<int>& known) const {
    const std::vector<SeenAgain> seen = FindSeenAgain(known);
    std::vector<PlacePair> pairs;
    for (const SeenAgain& one : seen) pairs.push_back(one.places);
    std::vector<size_t> agreed;
    const std::optional<Storage> motion = FindRigidMotion<Pose>(pairs, &agreed);
    if (!motion) return std::nullopt;
    State state = before_;
    int anchor = 0;
    for (const size_t row : agreed) anchor = std::max(anchor, seen[row].last_view);
    Storage target;
    Pose::Compose(motion->data(), before_.poses.row(begin_).data(), target.data());
    Bend(anchor, target, &state);
    DeadReckon(prepared_, begin_ + 1, end_, &state);
    MoveObjects(anchor, &state);
    return state;
  }

 private:
  std::vector<SeenAgain> FindSeenAgain(const std::vector<int>& known) const {
    const Graph& graph = context_.graph();
    std::vector<SeenAgain> found;
    for (const int object : known) {
      std::vector<int> rows;
      SeenAgain one{};
      for (const int row : prepared_.boxes_of_object[object]) {
        const int pose = graph.boxes.pose[row];
        if (pose < begin_) one.last_view = pose;
        if (pose >= begin_ && pose < end_) rows.push_back(row);
      }
      if (rows.empty()) continue;
      const Surface<double> surface = EllipsoidModel::Unpack(before_.landmarks.row(object).data());
      const std::vector<View> views = ViewsOf(prepared_, before_, rows);
      one.places = PlaceOf(graph.camera, views, surface);
      one.views = rows.size();
      found.push_back(one);
    }
    std::stable_sort(found.begin(), found.end(), [](const SeenAgain& a, const SeenAgain& b) {
      return a.views > b.views;
    });
    if (found.size() > kMostObjects) found.resize(kMostObjects);
    return found;
  }

  // Spreads the motion of the pose `begin_` to its target over the steps behind the anchor.
  void Bend(int anchor, const Storage& target, State* state) const {
    std::vector<Square> covariances;
    for (int pose = anchor + 1; pose <= begin_; ++pose) {
      covariances.emplace_back(Eigen::Map<const Eigen::Matrix<double, k, k, Eigen::RowMajor>>(
          context_.graph().odometry.covariance.row(prepared_.odometry_into[pose]).data()));
    }
    RowMatrix poses = state->poses.middleRows(anchor, begin_ - anchor + 1);
    BendPath<Pose>(covariances, target, &poses);
    state->poses.middleRows(anchor, begin_ - anchor + 1) = poses;
  }

  // Moves each object that was last seen behind the anchor with the pose that saw it.
  void MoveObjects(int anchor, State* state) const {
    const Graph& graph = context_.graph();
    for (int object = 0; object < graph.num_objects(); ++object) {
      int viewer = -1;
      for (const int row : prepared_.boxes_of_object[object]) {
        if (graph.boxes.pose[row] < begin_) viewer = graph.boxes.pose[row];
      }
      if (viewer <= anchor) continue;
      const Surface<double> surface =
          MoveWith<Pose>(before_.poses.row(viewer).data(),
                         state->poses.row(viewer).data(),
                         EllipsoidModel::Unpack(before_.landmarks.row(object).data()));
      state->landmarks.row(object) = EllipsoidFromSurface(surface).transpose();
    }
  }

  const SolveContext& context_;
  const PreparedGraph& prepared_;
  const int begin_, end_;
  const State& before_;
};

}  // namespace

std::optional<State> Realign(const SolveContext& context,
                             const std::vector<int>& known,
                             int begin,
                             int end,
                             const State& state) {
  if (context.options.landmark_model != LandmarkModel::kEllipsoid) return std::nullopt;
  return Dispatch(context.graph().pose_model, [&](auto pose) {
    return Realignment<decltype(pose)>(context, begin, end, state).Run(known);
  });
}

}  // namespace dqslam
