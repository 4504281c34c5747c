SELECT count(*)::BIGINT AS clips FROM clips;
