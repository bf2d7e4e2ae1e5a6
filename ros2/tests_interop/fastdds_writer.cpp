// Publishes sensor_msgs/CompressedImage with FastDDS: fastdds_writer DOMAIN TOPIC FRAME_ID. Each line of standard input is an image: the
// seconds and nanoseconds of its stamp, and a JPEG file.
// The type is written by hand as fastddsgen would: members in the order of CompressedImage.msg.
#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

using namespace eprosima::fastdds::dds;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;
using eprosima::fastrtps::rtps::SerializedPayload_t;

struct CompressedImage {
    int32_t sec;
    uint32_t nanosec;
    std::string frame_id;
    std::string format;
    std::vector<uint8_t> data;
};

// More than an image and its header.
constexpr uint32_t MOST_BYTES = 1 << 20;

class CompressedImageType : public TopicDataType {
public:
    CompressedImageType() {
        setName("sensor_msgs::msg::dds_::CompressedImage_");
        m_typeSize = MOST_BYTES;
        m_isGetKeyDefined = false;
    }
    bool serialize(void* data, SerializedPayload_t* payload) override {
        auto* image = static_cast<CompressedImage*>(data);
        FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
        Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
        cdr.serialize_encapsulation();
        cdr << image->sec << image->nanosec << image->frame_id << image->format << image->data;
        payload->encapsulation = cdr.endianness() == Cdr::BIG_ENDIANNESS ? CDR_BE : CDR_LE;
        payload->length = static_cast<uint32_t>(cdr.getSerializedDataLength());
        return true;
    }
    bool deserialize(SerializedPayload_t*, void*) override { return false; }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override { return [] { return MOST_BYTES; }; }
    void* createData() override { return new CompressedImage; }
    void deleteData(void* data) override { delete static_cast<CompressedImage*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

class Listener : public DataWriterListener {
    void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
        std::fprintf(stderr, "matched %d\n", status.current_count);
    }
};

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fprintf(stderr, "expected DOMAIN TOPIC FRAME_ID\n");
        return 2;
    }
    auto* factory = DomainParticipantFactory::get_instance();
    auto* participant = factory->create_participant(std::atoi(argv[1]), PARTICIPANT_QOS_DEFAULT);
    TypeSupport type(new CompressedImageType);
    type.register_type(participant);
    auto* topic = participant->create_topic(std::string("rt/") + argv[2], type.get_type_name(), TOPIC_QOS_DEFAULT);
    DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 10;
    Listener listener;
    auto* writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, qos, &listener);
    if (!writer) return 1;
    CompressedImage image{0, 0, argv[3], "jpeg", {}};
    std::string file;
    while (std::cin >> image.sec >> image.nanosec >> file) {
        std::ifstream jpeg(file, std::ios::binary);
        image.data.assign(std::istreambuf_iterator<char>(jpeg), {});
        if (image.data.empty() || !writer->write(&image)) {
            std::fprintf(stderr, "%s was not published\n", file.c_str());
            return 1;
        }
    }
    return 0;
}
