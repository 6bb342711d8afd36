// The reference C++ library (Debian package libopenigtlink-dev, protocol 2) as oracle for oracle_igtl.py.
//   pack   writes one message of each kind to standard output
//   check  reads messages from standard input, checks their CRC, prints what they hold, one line each
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include <igtlImageMessage.h>
#include <igtlMessageHeader.h>
#include <igtlPointMessage.h>
#include <igtlPolyDataMessage.h>
#include <igtlPositionMessage.h>
#include <igtlQuaternionTrackingDataMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTrackingDataMessage.h>
#include <igtlTrajectoryMessage.h>
#include <igtlTransformMessage.h>

static igtl::Matrix4x4 POSE = {{1, 0, 0, 10.5f}, {0, 0, -1, -20.25f}, {0, 1, 0, 30.125f}, {0, 0, 0, 1}};

template <class M> typename M::Pointer make(const char *device) {
  typename M::Pointer m = M::New();
  m->SetDeviceName(device);
  igtl::TimeStamp::Pointer t = igtl::TimeStamp::New();
  t->SetTime(1700000000.5);
  m->SetTimeStamp(t);
  return m;
}

static void write(igtl::MessageBase *m) {
  m->Pack();
  fwrite(m->GetPackPointer(), 1, m->GetPackSize(), stdout);
}

static void pack_poses() {
  auto transform = make<igtl::TransformMessage>("StylusToReference");
  transform->SetMatrix(POSE);
  write(transform);
  auto position = make<igtl::PositionMessage>("Tip");
  position->SetPosition(1, 2, 3);
  position->SetQuaternion(0, 0, 0.6f, 0.8f);
  write(position);
  auto tdata = make<igtl::TrackingDataMessage>("Tools");
  for (const char *name : {"Stylus", "Catheter"}) {
    igtl::TrackingDataElement::Pointer e = igtl::TrackingDataElement::New();
    e->SetName(name);
    e->SetType(igtl::TrackingDataElement::TYPE_6D);
    e->SetMatrix(POSE);
    tdata->AddTrackingDataElement(e);
  }
  write(tdata);
  auto qtdata = make<igtl::QuaternionTrackingDataMessage>("QTools");
  igtl::QuaternionTrackingDataElement::Pointer q = igtl::QuaternionTrackingDataElement::New();
  q->SetName("Stylus");
  q->SetType(igtl::QuaternionTrackingDataElement::TYPE_6D);
  q->SetPosition(1, 2, 3);
  q->SetQuaternion(0, 0, 0.6f, 0.8f);
  qtdata->AddQuaternionTrackingDataElement(q);
  write(qtdata);
}

static void pack_words() {
  auto status = make<igtl::StatusMessage>("Health");
  status->SetCode(13);
  status->SetSubCode(-7);
  status->SetErrorName("LOST");
  status->SetStatusString("stylus not seen");
  write(status);
  auto text = make<igtl::StringMessage>("EntryError");
  text->SetString("1.25 mm");
  write(text);
}

static void pack_shapes() {
  auto points = make<igtl::PointMessage>("Plan");
  igtl::PointElement::Pointer p = igtl::PointElement::New();
  p->SetName("Entry");
  p->SetGroupName("Fiducial");
  p->SetRGBA(255, 0, 10, 255);
  p->SetPosition(1, 2, 3);
  p->SetRadius(2.5);
  p->SetOwner("Plan");
  points->AddPointElement(p);
  write(points);
  auto path = make<igtl::TrajectoryMessage>("Path");
  igtl::TrajectoryElement::Pointer t = igtl::TrajectoryElement::New();
  t->SetName("EVD");
  t->SetGroupName("Trajectory");
  t->SetType(igtl::TrajectoryElement::TYPE_ENTRY_TARGET);
  t->SetRGBA(0, 255, 0, 255);
  t->SetEntryPosition(1, 2, 3);
  t->SetTargetPosition(4, 5, 6);
  t->SetRadius(3);
  t->SetOwner("");
  path->AddTrajectoryElement(t);
  write(path);

  auto mesh = make<igtl::PolyDataMessage>("Brain");
  igtl::PolyDataPointArray::Pointer corners = igtl::PolyDataPointArray::New();
  for (int i = 0; i < 8; i++) corners->AddPoint(i & 1, (i >> 1) & 1, (i >> 2) & 1);
  igtl::PolyDataCellArray::Pointer polygons = igtl::PolyDataCellArray::New(), lines = igtl::PolyDataCellArray::New();
  igtlUint32 faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (auto &f : faces) polygons->AddCell(4, f);
  igtlUint32 line[3] = {0, 3, 7};
  lines->AddCell(3, line);
  mesh->SetPoints(corners);
  mesh->SetPolygons(polygons);
  mesh->SetLines(lines);
  const char *names[2] = {"attr", "n"};
  for (int k = 0; k < 2; k++) {
    igtl::PolyDataAttribute::Pointer a = igtl::PolyDataAttribute::New();
    a->SetType(k == 0 ? igtl::PolyDataAttribute::POINT_SCALAR : igtl::PolyDataAttribute::CELL_NORMAL);
    a->SetName(names[k]);
    a->SetSize(k == 0 ? 8 : 6);
    std::vector<igtlFloat32> values(k == 0 ? 8 : 18);
    for (size_t i = 0; i < values.size(); i++) values[i] = 0.25f * i;
    a->SetData(values.data());
    mesh->AddAttribute(a);
  }
  write(mesh);

  auto image = make<igtl::ImageMessage>("Slice");
  int size[3] = {4, 3, 2};
  image->SetDimensions(size);
  image->SetSpacing(0.5, 0.5, 2.0);
  image->SetScalarType(igtl::ImageMessage::TYPE_INT16);
  image->SetEndian(igtl::ImageMessage::ENDIAN_LITTLE);
  image->SetMatrix(POSE);
  image->AllocateScalars();
  short *v = static_cast<short *>(image->GetScalarPointer());
  for (int i = 0; i < 24; i++) v[i] = short(100 * i - 1024);
  write(image);
}

template <class M> bool unpack(igtl::MessageHeader *header, std::vector<char> &body, typename M::Pointer &m) {
  m = M::New();
  m->SetMessageHeader(header);
  m->AllocatePack();
  memcpy(m->GetPackBodyPointer(), body.data(), body.size());
  return m->Unpack(1) & igtl::MessageHeader::UNPACK_BODY;  // 1: check the CRC
}

template <class M, class F> bool show(igtl::MessageHeader *h, std::vector<char> &body, F print) {
  typename M::Pointer m;
  if (!unpack<M>(h, body, m)) return false;
  printf("%s %s ", h->GetDeviceType(), h->GetDeviceName());
  print(m.GetPointer());
  printf("\n");
  return true;
}

static bool check_poses(const std::string &type, igtl::MessageHeader *h, std::vector<char> &body) {
  if (type == "TRANSFORM")
    return show<igtl::TransformMessage>(h, body, [](igtl::TransformMessage *m) {
      igtl::Matrix4x4 a;
      m->GetMatrix(a);
      printf("%g %g %g %.4f", a[0][3], a[1][3], a[2][3], a[2][1]);
    });
  if (type == "POSITION")
    return show<igtl::PositionMessage>(h, body, [](igtl::PositionMessage *m) {
      float p[3], q[4];
      m->GetPosition(p);
      m->GetQuaternion(q);
      printf("%g %g %g %.4f %.4f", p[0], p[1], p[2], q[0], q[3]);
    });
  if (type == "TDATA")
    return show<igtl::TrackingDataMessage>(h, body, [](igtl::TrackingDataMessage *m) {
      igtl::TrackingDataElement::Pointer e;
      m->GetTrackingDataElement(0, e);
      igtl::Matrix4x4 a;
      e->GetMatrix(a);
      printf("%d %s %d %g %.4f", m->GetNumberOfTrackingDataElements(), e->GetName(), e->GetType(), a[2][3], a[2][1]);
    });
  return show<igtl::QuaternionTrackingDataMessage>(h, body, [](igtl::QuaternionTrackingDataMessage *m) {
    igtl::QuaternionTrackingDataElement::Pointer e;
    m->GetQuaternionTrackingDataElement(0, e);
    float p[3], q[4];
    e->GetPosition(p);
    e->GetQuaternion(q);
    printf("%s %d %g %.4f", e->GetName(), e->GetType(), p[2], q[0]);
  });
}

static bool check_rest(const std::string &type, igtl::MessageHeader *h, std::vector<char> &body) {
  if (type == "STATUS")
    return show<igtl::StatusMessage>(h, body, [](igtl::StatusMessage *m) {
      printf("%d %lld %s %s", m->GetCode(), (long long)m->GetSubCode(), m->GetErrorName(), m->GetStatusString());
    });
  if (type == "STRING")
    return show<igtl::StringMessage>(h, body, [](igtl::StringMessage *m) { printf("%s", m->GetString()); });
  if (type == "POINT")
    return show<igtl::PointMessage>(h, body, [](igtl::PointMessage *m) {
      igtl::PointElement::Pointer e;
      m->GetPointElement(1, e);
      float p[3];
      e->GetPosition(p);
      printf("%d %s %s %g %g %g %g", m->GetNumberOfPointElement(), e->GetName(), e->GetGroupName(), p[0], p[1], p[2],
             e->GetRadius());
    });
  if (type == "TRAJ")
    return show<igtl::TrajectoryMessage>(h, body, [](igtl::TrajectoryMessage *m) {
      igtl::TrajectoryElement::Pointer e;
      m->GetTrajectoryElement(0, e);
      float a[3], b[3];
      e->GetEntryPosition(a);
      e->GetTargetPosition(b);
      printf("%s %d %g %g", e->GetName(), e->GetType(), a[2], b[2]);
    });
  if (type == "POLYDATA")
    return show<igtl::PolyDataMessage>(h, body, [](igtl::PolyDataMessage *m) {
      igtl::PolyDataAttribute *a = m->GetAttribute(0);
      float p[3];
      m->GetPoints()->GetPoint(1, p);
      printf("%d %d %g %s %d", m->GetPoints()->GetNumberOfPoints(), m->GetPolygons()->GetNumberOfCells(), p[0],
             a->GetName(), a->GetSize());
    });
  return show<igtl::ImageMessage>(h, body, [](igtl::ImageMessage *m) {
    int size[3];
    float centre[3];
    m->GetDimensions(size);
    m->GetOrigin(centre);
    short *v = static_cast<short *>(m->GetScalarPointer());
    printf("%d %d %d %g %g %g %d", size[0], size[1], size[2], centre[0], centre[1], centre[2], v[23]);
  });
}

static int check() {
  for (;;) {
    igtl::MessageHeader::Pointer header = igtl::MessageHeader::New();
    header->InitPack();
    size_t got = fread(header->GetPackPointer(), 1, header->GetPackSize(), stdin);
    if (got == 0) return 0;
    if (got != size_t(header->GetPackSize())) return 1;
    header->Unpack();
    std::vector<char> body(header->GetBodySizeToRead());
    if (fread(body.data(), 1, body.size(), stdin) != body.size()) return 1;
    std::string type = header->GetDeviceType();
    bool pose = type == "TRANSFORM" || type == "POSITION" || type == "TDATA" || type == "QTDATA";
    if (!(pose ? check_poses(type, header, body) : check_rest(type, header, body))) {
      printf("%s REFUSED\n", type.c_str());
      return 1;
    }
  }
}

int main(int argc, char **argv) {
  if (argc > 1 && !strcmp(argv[1], "check")) return check();
  pack_poses();
  pack_words();
  pack_shapes();
  return 0;
}
