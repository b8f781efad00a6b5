// Reads topics by eProsima Fast DDS, which ROS 2 uses by default, and prints each
// message as "TOPIC HEX", with the CDR encapsulation before. It knows nothing of the types but
// their names:
//     dds_reader DOMAIN SECONDS TOPIC TYPE [TOPIC TYPE]...
// It ends after these seconds, or, if it publishes nothing, once each topic had 30 messages.
// With a topic "publish:NAME" it publishes one byte there, an std_msgs/Empty, twice a second once a
// reader is there.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <string>
#include <thread>
#include <vector>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using Bytes = std::vector<unsigned char>;

class Raw : public TopicDataType
{
  public:
    explicit Raw(const char *name)
    {
        setName(name);
        m_typeSize = 1 << 16;
        m_isGetKeyDefined = false;
    }
    bool serialize(void *data, SerializedPayload_t *payload) override
    {
        const Bytes &bytes = *static_cast<Bytes *>(data);
        memcpy(payload->data, bytes.data(), bytes.size());
        payload->length = static_cast<uint32_t>(bytes.size());
        payload->encapsulation = CDR_LE;
        return true;
    }
    bool deserialize(SerializedPayload_t *payload, void *data) override
    {
        static_cast<Bytes *>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void *data) override
    {
        return [data] { return static_cast<uint32_t>(static_cast<Bytes *>(data)->size()); };
    }
    void *createData() override
    {
        return new Bytes;
    }
    void deleteData(void *data) override
    {
        delete static_cast<Bytes *>(data);
    }
    bool getKey(void *, InstanceHandle_t *, bool) override
    {
        return false;
    }
};

int main(int count, char **word)
{
    auto *participant = DomainParticipantFactory::get_instance()->create_participant(
        static_cast<uint32_t>(atoi(word[1])), PARTICIPANT_QOS_DEFAULT);
    auto *subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    auto *publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    std::vector<DataReader *> readers;
    std::vector<int> received;
    DataWriter *writer = nullptr;
    for (int k = 3; k + 1 < count; k += 2) {
        TypeSupport type(new Raw(word[k + 1]));
        type.register_type(participant);
        std::string name = word[k];
        const bool publish = name.rfind("publish:", 0) == 0;
        if (publish)
            name = name.substr(8);
        auto *topic = participant->create_topic(name, word[k + 1], TOPIC_QOS_DEFAULT);
        if (publish) {
            writer = publisher->create_datawriter(topic, DATAWRITER_QOS_DEFAULT);
            continue;
        }
        DataReaderQos quality = DATAREADER_QOS_DEFAULT; // as ROS: reliable, the last ten
        quality.reliability().kind = RELIABLE_RELIABILITY_QOS;
        quality.history().kind = KEEP_LAST_HISTORY_QOS;
        quality.history().depth = 10;
        readers.push_back(subscriber->create_datareader(topic, quality));
        received.push_back(0);
    }
    puts("ready");
    fflush(stdout);
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(atoi(word[2]));
    while (std::chrono::steady_clock::now() < end) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        PublicationMatchedStatus matched;
        if (writer != nullptr)
            writer->get_publication_matched_status(matched);
        if (writer != nullptr && matched.current_count > 0) {
            Bytes empty = {0, 1, 0, 0, 0}; // again, until the reader knows the writer too
            writer->write(&empty);
            std::this_thread::sleep_for(std::chrono::milliseconds(500));
        }
        bool enough = writer == nullptr;
        for (size_t k = 0; k < readers.size(); ++k) {
            auto *reader = readers[k];
            Bytes bytes;
            SampleInfo info;
            while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
                if (!info.valid_data)
                    continue;
                printf("%s ", reader->get_topicdescription()->get_name().c_str());
                for (unsigned char one : bytes)
                    printf("%02x", one);
                puts("");
                ++received[k];
            }
            enough = enough && received[k] >= 30;
        }
        fflush(stdout);
        if (enough)
            break;
    }
}
