// Registration methods of PCL, from stdin to stdout.
//
// pcl_driver METHOD < clouds > pose
// clouds: two int32 counts, then the float32 x y z of the source and of the target, both centred on
// their centroids, the unit of length being the diagonal of the target. pose: 16 numbers, row-major.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <pcl/features/fpfh_omp.h>
#include <pcl/features/normal_3d_omp.h>
#include <pcl/features/rops_estimation.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/kdtree/impl/kdtree_flann.hpp>
#include <pcl/point_types.h>
#include <pcl/recognition/ransac_based/trimmed_icp.h>
#include <pcl/registration/correspondence_rejection_sample_consensus.h>
#include <pcl/registration/gicp.h>
#include <pcl/registration/ia_ransac.h>
#include <pcl/registration/icp_nl.h>
#include <pcl/surface/gp3.h>

using Point = pcl::PointXYZ;
using Cloud = pcl::PointCloud<Point>;
using Normals = pcl::PointCloud<pcl::Normal>;
using Pose = Eigen::Matrix4f;
using Rops = pcl::Histogram<135>;  // 5 bins, 3 rotations: the size that the tutorial uses
using Method = Pose (*)(const Cloud::Ptr&, const Cloud::Ptr&);

constexpr float VOXEL = 0.02f;  // of features; normals take 2 of them, FPFH 5: Open3D's tutorial
constexpr float MESH = 0.01f;   // point spacing of the mesh that RoPS wants
constexpr float SUPPORT = 15 * MESH;  // RoPS, Guo et al. 2013: 15 mesh resolutions
constexpr float REACH = 1.5f * VOXEL;  // largest distance of an inlier pair
constexpr int FINE_ITERATIONS = 100;
constexpr std::size_t TRIMMED_POINTS = 2000;  // of the source; all 70,000 would take minutes

template <class T> typename pcl::search::KdTree<T>::Ptr tree() {
  return typename pcl::search::KdTree<T>::Ptr(new pcl::search::KdTree<T>);
}

Cloud::Ptr thinned(const Cloud::Ptr& cloud, float edge) {
  Cloud::Ptr out(new Cloud);
  pcl::VoxelGrid<Point> grid;
  grid.setInputCloud(cloud);
  grid.setLeafSize(edge, edge, edge);
  grid.filter(*out);
  return out;
}

Normals::Ptr normals(const Cloud::Ptr& cloud, float radius) {
  Normals::Ptr out(new Normals);
  pcl::NormalEstimationOMP<Point, pcl::Normal> estimation;
  estimation.setInputCloud(cloud);
  estimation.setSearchMethod(tree<Point>());
  estimation.setRadiusSearch(radius);
  estimation.setViewPoint(0, 0, 0);
  estimation.compute(*out);
  return out;
}

// Lets any ICP of PCL run from the pose T.
template <class Icp> Pose refined(Icp& icp, const Cloud::Ptr& x, const Cloud::Ptr& y, const Pose& T) {
  Cloud moved;
  icp.setInputSource(x);
  icp.setInputTarget(y);
  icp.setMaximumIterations(FINE_ITERATIONS);
  icp.setTransformationEpsilon(1e-10);
  icp.align(moved, T);
  return icp.getFinalTransformation();
}

Pose lm_icp(const Cloud::Ptr& x, const Cloud::Ptr& y) {
  pcl::IterativeClosestPointNonLinear<Point, Point> icp;
  return refined(icp, x, y, Pose::Identity());
}

// Mean squared distance of the nearest `count` points at the pose T.
double trimmed_error(const Cloud& x, const pcl::KdTreeFLANN<Point>& y, const Pose& T, int count) {
  pcl::Indices row(1);
  std::vector<float> squared(1), all;
  for (const Point& p : x) {
    Point moved;
    moved.getVector3fMap() = T.block<3, 3>(0, 0) * p.getVector3fMap() + T.block<3, 1>(0, 3);
    y.nearestKSearch(moved, 1, row, squared);
    all.push_back(squared[0]);
  }
  std::nth_element(all.begin(), all.begin() + count, all.end());
  double sum = 0;
  for (int i = 0; i < count; ++i) sum += all[i];
  return sum / count;
}

// Every n-th point, so that no more than `most` are left.
Cloud::Ptr some(const Cloud::Ptr& cloud, std::size_t most) {
  Cloud::Ptr out(new Cloud);
  const std::size_t step = (cloud->size() + most - 1) / most;
  for (std::size_t i = 0; i < cloud->size(); i += step) out->push_back((*cloud)[i]);
  return out;
}

// The overlap is the one that Chetverikov's objective, error / overlap^3, prefers.
Pose trimmed_icp(const Cloud::Ptr& source, const Cloud::Ptr& y) {
  const Cloud::Ptr x = some(source, TRIMMED_POINTS);
  pcl::recognition::TrimmedICP<Point, float> icp;
  icp.init(y);
  icp.setNewToOldEnergyRatio(0.9999f);
  pcl::KdTreeFLANN<Point> nearest;
  nearest.setInputCloud(y);
  Pose best = Pose::Identity();
  double least = std::numeric_limits<double>::max();
  for (double overlap : {0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99}) {
    const int count = static_cast<int>(overlap * x->size());
    Pose T = Pose::Identity();
    icp.align(*x, count, T);
    const double objective = trimmed_error(*x, nearest, T, count) / std::pow(overlap, 3);
    if (objective < least) least = objective, best = T;
  }
  return best;
}

pcl::PointCloud<pcl::FPFHSignature33>::Ptr fpfh(const Cloud::Ptr& cloud) {
  pcl::PointCloud<pcl::FPFHSignature33>::Ptr out(new pcl::PointCloud<pcl::FPFHSignature33>);
  pcl::FPFHEstimationOMP<Point, pcl::Normal, pcl::FPFHSignature33> estimation;
  estimation.setInputCloud(cloud);
  estimation.setInputNormals(normals(cloud, 2 * VOXEL));
  estimation.setSearchMethod(tree<Point>());
  estimation.setRadiusSearch(5 * VOXEL);
  estimation.compute(*out);
  return out;
}

Pose sac_ia(const Cloud::Ptr& source, const Cloud::Ptr& target) {
  const Cloud::Ptr x = thinned(source, VOXEL), y = thinned(target, VOXEL);
  pcl::SampleConsensusInitialAlignment<Point, Point, pcl::FPFHSignature33> sac;
  sac.setInputSource(x);
  sac.setSourceFeatures(fpfh(x));
  sac.setInputTarget(y);
  sac.setTargetFeatures(fpfh(y));
  sac.setMinSampleDistance(5 * VOXEL);
  sac.setMaxCorrespondenceDistance(REACH);
  sac.setMaximumIterations(1000);
  Cloud moved;
  sac.align(moved);
  return sac.getFinalTransformation();
}

std::vector<pcl::Vertices> mesh(const Cloud::Ptr& cloud) {
  pcl::PointCloud<pcl::PointNormal>::Ptr oriented(new pcl::PointCloud<pcl::PointNormal>);
  pcl::concatenateFields(*cloud, *normals(cloud, 4 * MESH), *oriented);
  pcl::GreedyProjectionTriangulation<pcl::PointNormal> greedy;
  greedy.setInputCloud(oriented);
  greedy.setSearchMethod(tree<pcl::PointNormal>());
  greedy.setSearchRadius(4 * MESH);
  greedy.setMu(2.5);
  greedy.setMaximumNearestNeighbors(100);
  greedy.setMaximumSurfaceAngle(M_PI / 4);
  greedy.setMinimumAngle(M_PI / 18);
  greedy.setMaximumAngle(2 * M_PI / 3);
  greedy.setNormalConsistency(false);
  std::vector<pcl::Vertices> triangles;
  greedy.reconstruct(triangles);
  return triangles;
}

pcl::PointCloud<Rops>::Ptr rops_features(const Cloud::Ptr& surface, const Cloud::Ptr& keypoints) {
  pcl::PointCloud<Rops>::Ptr out(new pcl::PointCloud<Rops>);
  pcl::ROPSEstimation<Point, Rops> estimation;
  estimation.setSearchMethod(tree<Point>());
  estimation.setSearchSurface(surface);
  estimation.setInputCloud(keypoints);
  estimation.setTriangles(mesh(surface));
  estimation.setRadiusSearch(SUPPORT);
  estimation.setSupportRadius(SUPPORT);
  estimation.setNumberOfPartitionBins(5);
  estimation.setNumberOfRotations(3);
  estimation.compute(*out);
  return out;
}

// Of each row of x the row of y with the nearest feature.
pcl::CorrespondencesPtr matched(const pcl::PointCloud<Rops>& x, const pcl::PointCloud<Rops>& y) {
  using Row = Eigen::Map<const Eigen::Matrix<float, 135, 1>>;
  pcl::CorrespondencesPtr out(new pcl::Correspondences);
  for (std::size_t i = 0; i < x.size(); ++i) {
    pcl::Correspondence match(i, 0, std::numeric_limits<float>::max());
    for (std::size_t j = 0; j < y.size(); ++j) {
      const float apart = (Row(x[i].histogram) - Row(y[j].histogram)).squaredNorm();
      if (apart < match.distance) match.index_match = j, match.distance = apart;
    }
    out->push_back(match);
  }
  return out;
}

Pose rops(const Cloud::Ptr& source, const Cloud::Ptr& target) {
  const Cloud::Ptr x = thinned(source, 2 * VOXEL), y = thinned(target, 2 * VOXEL);
  const auto matches =
      matched(*rops_features(thinned(source, MESH), x), *rops_features(thinned(target, MESH), y));
  pcl::registration::CorrespondenceRejectorSampleConsensus<Point> ransac;
  ransac.setInputSource(x);
  ransac.setInputTarget(y);
  ransac.setInlierThreshold(2 * REACH);
  ransac.setMaximumIterations(50000);
  ransac.setRefineModel(true);
  ransac.setInputCorrespondences(matches);
  pcl::Correspondences kept;
  ransac.getCorrespondences(kept);
  return ransac.getBestTransformation();
}

Pose rops_gicp(const Cloud::Ptr& source, const Cloud::Ptr& target) {
  pcl::GeneralizedIterativeClosestPoint<Point, Point> icp;
  icp.setMaxCorrespondenceDistance(2 * REACH);
  return refined(icp, thinned(source, MESH), thinned(target, MESH), rops(source, target));
}

const std::map<std::string, Method> METHODS = {{"lm_icp", lm_icp},
                                               {"trimmed_icp", trimmed_icp},
                                               {"sac_ia", sac_ia},
                                               {"rops", rops},
                                               {"rops_gicp", rops_gicp}};

Cloud::Ptr read_cloud(std::int32_t count) {
  std::vector<float> numbers(3 * static_cast<std::size_t>(count));
  if (std::fread(numbers.data(), sizeof(float), numbers.size(), stdin) != numbers.size())
    throw std::runtime_error("the clouds end early");
  Cloud::Ptr cloud(new Cloud);
  for (std::size_t i = 0; i < numbers.size(); i += 3)
    cloud->emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  return cloud;
}

int main(int argc, char** argv) try {
  const auto method = argc == 2 ? METHODS.find(argv[1]) : METHODS.end();
  if (method == METHODS.end()) throw std::runtime_error("usage: pcl_driver METHOD < clouds");
  std::int32_t counts[2];
  if (std::fread(counts, sizeof counts, 1, stdin) != 1) throw std::runtime_error("no counts");
  const Cloud::Ptr source = read_cloud(counts[0]), target = read_cloud(counts[1]);
  const Pose T = method->second(source, target);
  for (int i = 0; i < 16; ++i) std::printf("%.9g ", T(i / 4, i % 4));
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "pcl_driver: %s\n", error.what());
  return 1;
}
