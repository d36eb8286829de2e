// MRPT's EKF-SLAM (CRangeBearingKFSLAM2D) behind functions of C.
//
// MRPT has one noise for all sightings. Its class has a function to be overridden for that, which gives each sighting
// its own covariance here: those of a step that share one are taken together, the others in turn, without a motion in
// between.
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservationBearingRange.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPosePDFGaussian.h>
#include <mrpt/slam/CRangeBearingKFSLAM2D.h>

#include <algorithm>
#include <cstring>
#include <set>
#include <string>

using namespace mrpt::obs;
using namespace mrpt::poses;

namespace
{
std::string failure;

class Filter : public mrpt::slam::CRangeBearingKFSLAM2D
{
   public:
    Filter(int davison, const double* pose, const double* cov, int landmarks, const double* xy, const double* xy_cov)
    {
        KF_options.method = davison ? mrpt::bayes::kfEKFAlaDavison : mrpt::bayes::kfEKFNaive;
        KF_options.verbosity_level = mrpt::system::LVL_ERROR;
        const int n = 3 + 2 * landmarks;
        m_xkk.resize(n);
        m_pkk.setZero(n, n);
        std::copy(pose, pose + 3, &m_xkk[0]);
        std::copy(xy, xy + 2 * landmarks, &m_xkk[0] + 3);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) m_pkk(i, j) = cov[3 * i + j];
        for (int i = 0; xy_cov && i < 2 * landmarks; i++)
            for (int j = 0; j < 2 * landmarks; j++) m_pkk(3 + i, 3 + j) = xy_cov[2 * landmarks * i + j];
        for (int i = 0; i < landmarks; i++) m_IDs.insert(i, i);
    }

    // Predicts by a motion, null for none, and corrects by sightings (id, range, bearing) of one covariance (2, 2).
    void take(const double* delta, const double* delta_cov, int n, const int* ids, const double* z, const double* cov)
    {
        moves = delta != nullptr;
        if (cov) std::copy(cov, cov + 4, noise);
        CPosePDFGaussian motion;
        if (moves)
        {
            motion.mean = CPose2D(delta[0], delta[1], delta[2]);
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) motion.cov(i, j) = delta_cov[3 * i + j];
        }
        CActionRobotMovement2D moved;
        moved.poseChange = CPosePDFGaussian::Create(motion);
        auto action = std::make_shared<CActionCollection>();
        action->insert(moved);
        auto seen = std::make_shared<CObservationBearingRange>();
        seen->fieldOfView_yaw = 6.2832f;
        for (int i = 0; i < n; i++)
        {
            CObservationBearingRange::TMeasurement sighting;
            sighting.landmarkID = ids[i];
            sighting.range = z[2 * i];
            sighting.yaw = z[2 * i + 1];
            sighting.pitch = 0;
            seen->maxSensorDistance = std::max(seen->maxSensorDistance, sighting.range + 1.0f);
            seen->sensedData.push_back(sighting);
        }
        auto frame = std::make_shared<CSensoryFrame>();
        frame->insert(seen);
        processActionObservation(action, frame);
    }

    void state(double* pose, double* cov) const
    {
        std::copy(&m_xkk[0], &m_xkk[0] + 3, pose);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) cov[3 * i + j] = m_pkk(i, j);
    }

    int landmarks() const { return (static_cast<int>(m_xkk.size()) - 3) / 2; }

    void map(int* ids, double* xy, double* cov) const
    {
        const int n = 2 * landmarks();
        for (const auto& [id, index] : m_IDs) ids[index] = static_cast<int>(id);
        std::copy(&m_xkk[0] + 3, &m_xkk[0] + 3 + n, xy);
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) cov[n * i + j] = m_pkk(3 + i, 3 + j);
    }

   protected:
    // MRPT's own leaves out all motions before the first landmark, and their noise.
    void OnTransitionModel(const KFArray_ACT& u, KFArray_VEH& x, bool& skip) const override
    {
        skip = !moves;
        const CPose2D after = CPose2D(x[0], x[1], x[2]) + CPose2D(u[0], u[1], u[2]);
        if (moves)
            for (int i = 0; i < 3; i++) x[i] = after[i];
    }

    void OnGetObservationNoise(KFMatrix_OxO& R) const override
    {
        for (int i = 0; i < 2; i++)
            for (int j = 0; j < 2; j++) R(i, j) = noise[2 * i + j];
    }

    // The naive update, (I - K H) P, loses its symmetry, and then the estimate.
    void OnPostIteration() override { m_pkk = (0.5 * (m_pkk.asEigen() + m_pkk.asEigen().transpose())).eval(); }

   private:
    bool moves = false;
    double noise[4] = {1, 0, 0, 1};
};
}  // namespace

extern "C"
{
    const char* why() { return failure.c_str(); }

    void* make(
        int davison, const double* pose, const double* cov, int landmarks, const double* xy, const double* xy_cov)
    {
        return new Filter(davison, pose, cov, landmarks, xy, xy_cov);
    }

    void drop(void* filter) { delete static_cast<Filter*>(filter); }

    // Sightings ids (n), z (n, 2), cov (n, 2, 2); 0, or 1 with the reason in why().
    int step(
        void* filter, const double* delta, const double* delta_cov, int n, const int* ids, const double* z,
        const double* cov, double* pose, double* pose_cov)
    {
        auto* one = static_cast<Filter*>(filter);
        try
        {
            int done = 0;
            do
            {
                std::set<int> taken;
                int end = done;
                while (end < n && !std::memcmp(cov + 4 * end, cov + 4 * done, 4 * sizeof(double)) &&
                       taken.insert(ids[end]).second)
                    end++;
                one->take(
                    done ? nullptr : delta, delta_cov, end - done, ids + done, z + 2 * done, n ? cov + 4 * done : nullptr);
                done = end;
            } while (done < n);
            one->state(pose, pose_cov);
        }
        catch (const std::exception& error)
        {
            failure = error.what();
            return 1;
        }
        return 0;
    }

    int landmarks(void* filter) { return static_cast<Filter*>(filter)->landmarks(); }

    void map(void* filter, int* ids, double* xy, double* cov) { static_cast<Filter*>(filter)->map(ids, xy, cov); }
}
